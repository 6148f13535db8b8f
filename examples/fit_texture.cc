// SPDX-License-Identifier: Apache-2.0
// A texture from pictures: a batch of views of one mesh, whose gradients meet in one array.
#include <algorithm>

#include "fit.h"

namespace {

constexpr int kTexture = 16, kViews = 4, kSize = 64;

// A picture of coloured squares, [kTexture,kTexture,3].
std::vector<float> Squares() {
  std::vector<float> texels;
  for (int i = 0; i < kTexture; ++i) {
    for (int j = 0; j < kTexture; ++j) {
      const bool dark = (i / 4 + j / 4) % 2 == 0;
      texels.insert(texels.end(), {dark ? 0.1f : 0.9f, static_cast<float>(i) / kTexture, 0.5f});
    }
  }
  return texels;
}

}  // namespace

int main() {
  const std::vector<float> positions = {-0.6f, -0.6f, 0, 0.6f,  -0.6f, 0,
                                        0.6f,  0.6f,  0, -0.6f, 0.6f,  0};
  const std::vector<int> faces = {0, 1, 2, 0, 2, 3};
  const std::vector<float> uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  const std::vector<float> truth = Squares();
  tilegrad::Texture texture{
      .texels = truth, .width = kTexture, .height = kTexture, .wrap = tilegrad::Wrap::kClamp};
  std::vector<tilegrad::Scene> views(kViews);
  for (int n = 0; n < kViews; ++n) {  // azimuth 90 looks at the square from the front
    const tilegrad::Orbit orbit{
        .azimuth = 60.0 + 20 * n, .elevation = 10.0 * n - 15, .distance = 1.6};
    views[n] = {
        .positions = positions,
        .faces = faces,
        .camera = fit::Check(tilegrad::MakeCamera({.width = kSize, .height = kSize}, orbit)),
        .uvs = {uvs},
        .textures = {&texture, 1}};
  }
  tilegrad::Renderer renderer;
  tilegrad::Frame frame;
  const tilegrad::RenderOptions options{.width = kSize, .height = kSize};
  fit::Check(renderer.Render(views, options, {.alpha = false}, &frame));
  const std::vector<float> target(frame.images().color.begin(), frame.images().color.end());

  std::vector<float> texels(truth.size(), 0.5f), d_texels(truth.size()), d_color;
  texture.texels = texels;
  const std::span<float> d_textures[] = {d_texels};
  const std::vector<tilegrad::SceneGradients> d_views(kViews, {.textures = d_textures});
  fit::Adam adam(0.05f);
  for (int step = 0; step <= 100; ++step) {
    fit::Check(renderer.Render(views, options, {.alpha = false}, &frame));
    const float loss = fit::Difference(frame.images().color, target, &d_color);
    fit::Check(renderer.Backward(frame, {.color = d_color}, d_views));
    if (step % 20 == 0) std::printf("step %3d: loss %.2e\n", step, loss);
    adam.Step(texels, d_texels);
  }
  float worst = 0;
  for (std::size_t i = 0; i < texels.size(); ++i)
    worst = std::max(worst, std::abs(texels[i] - truth[i]));
  std::printf("no texel is farther than %.4f from the truth\n", worst);
  return worst < 0.05f ? 0 : 1;
}

// SPDX-License-Identifier: Apache-2.0
// A class of your own around the renderer: it owns the renderer and a frame, and answers how well a
// mesh fits a mask. Many of them may live side by side, each on a thread of yours.
#include <tilegrad/tilegrad.h>

#include <cstdio>
#include <span>
#include <utility>
#include <vector>

class SilhouetteLoss {
 public:
  SilhouetteLoss(tilegrad::RenderOptions options, std::vector<float> mask)
      : options_(options), mask_(std::move(mask)), d_alpha_(mask_.size()) {}

  // The mean square difference of alpha and mask; adds its gradient to d_positions.
  tilegrad::Result<float> Add(const tilegrad::Scene& scene, std::span<float> d_positions) {
    TILEGRAD_TRY(renderer_.Render({&scene, 1}, options_, {.color = false}, &frame_));
    const std::span<const float> alpha = frame_.images().alpha;
    const float scale = 1.0f / static_cast<float>(alpha.size());
    float loss = 0;
    for (std::size_t i = 0; i < alpha.size(); ++i) {
      const float difference = alpha[i] - mask_[i];
      loss += scale * difference * difference;
      d_alpha_[i] = 2 * scale * difference;
    }
    const tilegrad::SceneGradients d_scene{.positions = d_positions};
    TILEGRAD_TRY(renderer_.Backward(frame_, {.alpha = d_alpha_}, {&d_scene, 1},
                                    tilegrad::GradientMode::kAdd));
    return loss;
  }

 private:
  tilegrad::RenderOptions options_;
  std::vector<float> mask_, d_alpha_;
  tilegrad::Renderer renderer_{{.threads = 1}};  // the caller's thread and no other
  tilegrad::Frame frame_;
};

int main() {
  std::vector<float> positions = {-0.5f, -0.4f, -2, 0.5f, -0.4f, -2, 0, 0.6f, -2};
  const std::vector<int> faces = {0, 1, 2};
  const tilegrad::Scene scene{.positions = positions, .faces = faces};
  SilhouetteLoss loss({.width = 64, .height = 64, .delta = 1e-3}, std::vector<float>(64 * 64));
  std::vector<float> d_positions(positions.size());
  const tilegrad::Result<float> value = loss.Add(scene, d_positions);
  if (!value.ok()) {
    std::fprintf(stderr, "%s\n", value.status().message().c_str());
    return 1;
  }
  std::printf("tilegrad %s: loss %.4f, d_positions[0] %.4f\n", TILEGRAD_VERSION, *value,
              d_positions[0]);
  return *value > 0 && d_positions[0] < 0 ? 0 : 1;  // a mask without anything: shrink
}

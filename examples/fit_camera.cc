// SPDX-License-Identifier: Apache-2.0
// From which side was the picture taken? Adam on the free parameters of a camera.
#include <algorithm>

#include "fit.h"

namespace {

constexpr int kSize = 64;

// Parameters in one row for the optimiser: rotation, translation.
using Row = std::vector<float>;
Row RowOf(const tilegrad::CameraParameters& p) {
  Row row(p.rotation, p.rotation + 6);
  row.insert(row.end(), p.translation, p.translation + 3);
  return row;
}
tilegrad::CameraParameters ParametersOf(const Row& row, tilegrad::CameraParameters p) {
  std::copy_n(row.begin(), 6, p.rotation);
  std::copy_n(row.begin() + 6, 3, p.translation);
  return p;
}

float DegreesBetween(const tilegrad::Camera& a, const tilegrad::Camera& b) {
  float trace = 0;
  for (int i = 0; i < 9; ++i) trace += a.rotation[i] * b.rotation[i];
  return std::acos(std::clamp((trace - 1) / 2, -1.0f, 1.0f)) * 57.29578f;
}

}  // namespace

int main() {
  const fit::Box box;
  const tilegrad::Lens lens{.width = kSize, .height = kSize};
  const auto truth =
      fit::Check(tilegrad::MakeCamera(lens, {.azimuth = 40, .elevation = 25, .distance = 2}));
  tilegrad::Scene scene{
      .positions = box.positions, .faces = box.faces, .camera = truth, .colors = {box.colors}};
  tilegrad::Renderer renderer;
  tilegrad::Frame frame;
  tilegrad::RenderOptions options{.width = kSize, .height = kSize, .delta = 1e-2};
  fit::Check(renderer.Render({&scene, 1}, options, {}, &frame));
  const std::vector<float> color(frame.images().color.begin(), frame.images().color.end());
  const std::vector<float> alpha(frame.images().alpha.begin(), frame.images().alpha.end());

  const auto start =
      fit::Check(tilegrad::MakeCamera(lens, {.azimuth = 60, .elevation = 10, .distance = 2.4}));
  tilegrad::CameraParameters parameters = tilegrad::ParametersOf(start);
  Row row = RowOf(parameters);
  fit::Adam adam(0.02f);
  std::vector<float> d_color, d_alpha;
  tilegrad::Camera d_camera;
  const tilegrad::SceneGradients d_scene{.camera = &d_camera};
  for (int step = 0; step <= 300; ++step) {
    adam.SetRate(0.02f * std::pow(0.01f, static_cast<float>(step) / 300));
    parameters = ParametersOf(row, parameters);
    scene.camera = fit::Check(tilegrad::CameraFromParameters(parameters));
    fit::Check(renderer.Render({&scene, 1}, options, {}, &frame));
    const float loss = fit::Difference(frame.images().color, color, &d_color) +
                       fit::Difference(frame.images().alpha, alpha, &d_alpha);
    fit::Check(renderer.Backward(frame, {.color = d_color, .alpha = d_alpha}, {&d_scene, 1}));
    adam.Step(row, RowOf(tilegrad::PullBack(parameters, d_camera)));
    if (step % 50 == 0) {
      std::printf("step %3d: loss %.2e, %.3f degrees off\n", step, loss,
                  DegreesBetween(scene.camera, truth));
    }
  }
  return DegreesBetween(scene.camera, truth) < 0.5f ? 0 : 1;
}

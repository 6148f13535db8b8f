// SPDX-License-Identifier: Apache-2.0
// Gradient descent on one vertex: where is the top of the triangle in a picture? Alpha pulls from
// outside of the triangle, colours that are interpolated over it pull from inside.
#include "fit.h"

int main() {
  const std::vector<float> truth = {-0.5f, -0.4f, -2, 0.5f, -0.4f, -2, 0.2f, 0.6f, -2};
  const std::vector<int> faces = {0, 1, 2};
  const std::vector<float> colors = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::vector<float> positions = truth;
  tilegrad::Scene scene{.positions = positions, .faces = faces, .camera = {}, .colors = {colors}};
  tilegrad::Renderer renderer;
  tilegrad::Frame frame;

  // A softer silhouette is felt from farther away: here it fades over about two pixels.
  const tilegrad::RenderOptions options{.width = 64, .height = 64, .delta = 4e-3};
  fit::Check(renderer.Render({&scene, 1}, options, {}, &frame));
  const std::vector<float> alpha(frame.images().alpha.begin(), frame.images().alpha.end());
  const std::vector<float> color(frame.images().color.begin(), frame.images().color.end());

  positions[6] = -0.3f;
  positions[7] = 0.3f;  // the top, moved away
  std::vector<float> d_positions(9), d_alpha, d_color;
  const tilegrad::SceneGradients d_scene{.positions = d_positions};
  for (int step = 0; step <= 40; ++step) {
    fit::Check(renderer.Render({&scene, 1}, options, {}, &frame));
    const float loss = fit::Difference(frame.images().alpha, alpha, &d_alpha) +
                       fit::Difference(frame.images().color, color, &d_color);
    fit::Check(renderer.Backward(frame, {.color = d_color, .alpha = d_alpha}, {&d_scene, 1}));
    if (step % 10 == 0) {
      std::printf("step %3d: loss %.2e, top at (%.4f, %.4f)\n", step, loss, positions[6],
                  positions[7]);
    }
    for (int axis = 6; axis < 8; ++axis) positions[axis] -= 1.0f * d_positions[axis];
  }
  const float distance = std::hypot(positions[6] - truth[6], positions[7] - truth[7]);
  std::printf("%.5f world units from the truth\n", distance);
  return distance < 1e-2f ? 0 : 1;
}

// SPDX-License-Identifier: Apache-2.0
// One triangle: its image, and which way its corners would have to move for the silhouette to grow.
#include <tilegrad/tilegrad.h>

#include <cstdio>
#include <vector>

int main() {
  // A scene is views over your arrays. The camera stands at the origin and looks along -z.
  const std::vector<float> positions = {-0.5f, -0.4f, -2, 0.5f, -0.4f, -2, 0, 0.6f, -2};
  const std::vector<int> faces = {0, 1, 2};
  const std::vector<float> colors = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const tilegrad::Scene scene{
      .positions = positions, .faces = faces, .camera = {}, .colors = {colors}};

  // Scenes in, images out. delta is how soft the silhouette is: here about a pixel.
  tilegrad::Renderer renderer;
  tilegrad::Frame frame;
  tilegrad::Status status =
      renderer.Render({&scene, 1}, {.width = 64, .height = 64, .delta = 1e-3}, {}, &frame);
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.message().c_str());
    return 1;
  }
  const tilegrad::Images& images = frame.images();

  for (int row = 14; row < 50; row += 2) {  // every second row: characters are higher than wide
    for (int column = 12; column < 52; ++column) {
      std::putchar(" .:-=+*#%@"[static_cast<int>(9.9f * images.alpha[row * 64 + column])]);
    }
    std::putchar('\n');
  }

  // Gradients of images in, gradients of scenes out. The loss is the sum of alpha: the area.
  const std::vector<float> d_alpha(images.alpha.size(), 1.0f);
  std::vector<float> d_positions(positions.size());
  const tilegrad::SceneGradients d_scene{.positions = d_positions};
  status = renderer.Backward(frame, {.alpha = d_alpha}, {&d_scene, 1});
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.message().c_str());
    return 1;
  }

  for (int v = 0; v < 3; ++v) {
    std::printf(
        "vertex %d: the silhouette grows by (%6.1f, %6.1f) pixels for each unit to the "
        "right and up\n",
        v, d_positions[3 * v], d_positions[3 * v + 1]);
  }
  // Outward, for each of them.
  const bool right = d_positions[0] < 0 && d_positions[1] < 0 && d_positions[3] > 0 &&
                     d_positions[4] < 0 && d_positions[7] > 0;
  return right ? 0 : 1;
}

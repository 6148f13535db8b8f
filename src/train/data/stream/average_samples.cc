// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/average_samples.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::train {
namespace {

// Of planar vectors; 0 stays.
void MakeUnit(std::size_t pixels, std::span<float> planes) {
  for (std::size_t p = 0; p < pixels; ++p) {
    double square = 0;
    for (std::size_t c = 0; c < 3; ++c)
      square += double{planes[c * pixels + p]} * double{planes[c * pixels + p]};
    if (square == 0) continue;
    const auto factor = static_cast<float>(1 / std::sqrt(square));
    for (std::size_t c = 0; c < 3; ++c) planes[c * pixels + p] *= factor;
  }
}

}  // namespace

void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to) {
  const auto width = static_cast<std::size_t>(images.width), k = static_cast<std::size_t>(samples);
  const std::size_t side = width / k, plane = width * width, pixels = side * side;
  const float share = 1.0f / static_cast<float>(samples * samples);
  const bool colors = !images.color.empty();
  const std::span<const float> values = colors ? images.color : images.normals;
  std::fill(to.begin(), to.end(), 0.0f);
  for (std::size_t y = 0; y < width; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t from = y * width + x, at = y / k * side + x / k;
      if (images.face_ids[n * plane + from] < 0) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = values[(3 * n + c) * plane + from];
        to[c * pixels + at] += share * (colors ? std::clamp(value, 0.0f, 1.0f) : value);
      }
      to[3 * pixels + at] += share;
    }
  }
  if (!colors) MakeUnit(pixels, to);
}

}  // namespace tilegrad::train

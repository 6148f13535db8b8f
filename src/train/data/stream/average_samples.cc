// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/average_samples.h"

#include <algorithm>

namespace tilegrad::train {

void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to) {
  const auto width = static_cast<std::size_t>(images.width), k = static_cast<std::size_t>(samples);
  const std::size_t side = width / k, plane = width * width, pixels = side * side;
  const float share = 1.0f / static_cast<float>(samples * samples);
  std::fill(to.begin(), to.end(), 0.0f);
  for (std::size_t y = 0; y < width; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t from = y * width + x, at = y / k * side + x / k;
      if (images.face_ids[n * plane + from] < 0) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = images.color[(3 * n + c) * plane + from];
        to[c * pixels + at] += share * std::clamp(value, 0.0f, 1.0f);
      }
      to[3 * pixels + at] += share;
    }
  }
}

}  // namespace tilegrad::train

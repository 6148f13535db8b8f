// SPDX-License-Identifier: Apache-2.0
#include "fit/pictures.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::train {

ImageU8 OverWhite(const Images& frame, std::size_t n) {
  ImageU8 out(frame.width, frame.height, 3);
  const std::size_t plane = out.pixels.size() / 3;
  for (std::size_t p = 0; p < plane; ++p) {
    const bool drawn = frame.face_ids[n * plane + p] >= 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = drawn ? frame.color[(3 * n + c) * plane + p] : 1.0f;
      out.pixels[3 * p + c] =
          static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
    }
  }
  return out;
}

}  // namespace tilegrad::train

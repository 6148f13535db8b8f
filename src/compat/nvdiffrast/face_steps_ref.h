// SPDX-License-Identifier: Apache-2.0
// face_steps.h, pixel by pixel.
#pragma once

#include <algorithm>

#include "compat/nvdiffrast/face_steps.h"

namespace tilegrad::compat::nvdiffrast {

// Pixels from `begin` on.
template <class T>
std::size_t ReadFaceRowRef(std::span<const T> rast, std::size_t faces, FaceRow* out,
                           std::size_t begin = 0) {
  std::size_t bad = kNoPixel;
  const std::size_t width = rast.size() / 4;
  for (std::size_t x = begin; x < width; ++x) {
    const T id = rast[4 * x + 3];
    const bool exists = IsFaceId(id, faces);
    if (!exists) bad = std::min(bad, x);
    out->ids[x] = exists ? static_cast<std::int32_t>(id) : 0;
  }
  out->ids[width] = out->ids[width - 1];
  return bad;
}

inline void FindStepsRef(const FaceRow& row, const FaceRow& above, std::size_t width,
                         std::span<std::uint64_t> steps) {
  std::fill(steps.begin(), steps.end(), 0);
  for (std::size_t x = 0; x < width; ++x) {
    const bool step = row.ids[x] != row.ids[x + 1] || row.ids[x] != above.ids[x];
    steps[x / kStepBits] |= static_cast<std::uint64_t>(step) << x % kStepBits;
  }
}

}  // namespace tilegrad::compat::nvdiffrast

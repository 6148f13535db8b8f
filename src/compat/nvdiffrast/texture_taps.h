// SPDX-License-Identifier: Apache-2.0
// The texels that a lookup reads in one level, and their weights.
#pragma once

#include <cstddef>

#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_point.h"

namespace tilegrad::compat::nvdiffrast {

// Four texels (one, if nearest): (1-a)(1-b), a(1-b), (1-a)b and ab of what stands at texel[0..3].
struct Taps {
  static constexpr std::ptrdiff_t kNothing = -1;  // zeros
  static constexpr std::ptrdiff_t kMean = -2;     // the mean of the other three

  std::ptrdiff_t texel[4];  // counted over the faces of one texture
  int count;
  double a, b;
  double slope_a, slope_b;  // da/ds, db/dt

  double weight(int k) const {
    if (count == 1) return 1;
    return (k % 2 == 0 ? 1 - a : a) * (k / 2 == 0 ? 1 - b : b);
  }
};

// The texel of a face in column x and row y, or what there is beyond it; of a cube map at most one
// step beyond.
std::ptrdiff_t TexelAt(int x, int y, int face, const MipSize& size, TextureBoundary boundary);

// Overwrites *out; `point` is valid.
void FindTaps(const TexturePoint& point, const MipSize& size, bool nearest,
              TextureBoundary boundary, Taps* out);

}  // namespace tilegrad::compat::nvdiffrast

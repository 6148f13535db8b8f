// SPDX-License-Identifier: Apache-2.0
// The unit of work of shading kernels: a run of foreground pixels, gathered so that background
// pixels cost nothing. One plane per component.
#pragma once

#include <cstddef>

namespace tilegrad::shade {

inline constexpr std::size_t kRunPixels = 256;  // a multiple of every vector, and small enough that
                                                // some forty planes stay in the L1 cache
inline constexpr std::size_t kRunPad = 16;      // lanes of the widest vector

// Kernels take `count` <= kRunPixels and may read and write whole vectors beyond it: inputs there
// are copies of the last pixel's, and cotangents there are 0.
struct alignas(128) RunPlane {
  float at[kRunPixels];
};

}  // namespace tilegrad::shade

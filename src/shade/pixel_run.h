// SPDX-License-Identifier: Apache-2.0
// The unit of work of shading kernels: a run of foreground pixels, gathered so that background
// pixels cost nothing. One plane per component.
#pragma once

#include <cstddef>

namespace tilegrad::shade {

inline constexpr std::size_t kRunPixels = 256;  // a multiple of every vector length, and small
                                                // enough that some forty planes stay in L1
inline constexpr std::size_t kRunPad = 16;      // lanes of the widest vector

// Kernels take `count` <= kRunPixels and may read and write whole vectors beyond it: there inputs
// repeat the last pixel, and cotangents are 0.
struct alignas(128) RunPlane {
  float at[kRunPixels];
};

}  // namespace tilegrad::shade

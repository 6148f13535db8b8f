// SPDX-License-Identifier: Apache-2.0
// What visibility hands on: per pixel, which face is seen. Barycentric weights are recomputed by
// whoever needs them.
#pragma once

#include <cstdint>
#include <span>

namespace tilegrad::raster {

inline constexpr std::int32_t kNoFace = -1;  // a background pixel

// Views of one image, row 0 on top, [height][width] without padding; memory belongs to the Frame.
struct Fragments {
  std::span<std::int32_t> face;  // face of the caller's mesh, or kNoFace
  std::span<float> depth;  // -p_cam.z at the pixel centre; +infinity at background pixels. Empty
                           // where not wanted
  int width = 0, height = 0;
};

}  // namespace tilegrad::raster

// SPDX-License-Identifier: Apache-2.0
// Colours of SoftRas: at each pixel the faces mix, weighted by their probability and by how near
// they are,
//
//   I = (sum_j D_j e^(zn_j / gamma) C_j + b C_background) / (sum_j D_j e^(zn_j / gamma) + b)
//
// with zn_j = (far - z) / (far - near) of the face at the pixel and b = e^(2 eps / gamma), or they
// are those of the nearest face. What is published and what is repaired: docs/training.md.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "rivals/softras.h"

namespace tilegrad::rivals {

enum class SoftColor {
  kSoftmax,
  kHard,  // of the nearest face that covers the pixel; gradients to textures only
};
enum class SoftTexture {
  kVertex,   // three colours a face, interpolated linearly on the image
  kSurface,  // resolution x resolution texels a face, the nearest one
};

struct SoftRasColors {
  SoftColor color = SoftColor::kSoftmax;
  SoftTexture texture = SoftTexture::kVertex;
  int resolution = 1;   // kSurface: 1..64
  double gamma = 1e-4;  // > 0
  double eps = 1e-3;    // of the background's weight
  double background[3] = {0, 0, 0};
  bool double_side =
      true;  // false: faces that turn clockwise on the image, y up, alone have colour
  // Repairs, off in the published form.
  bool background_once = false;    // b = e^(eps / gamma), as in the paper
  bool inverse_depth = false;      // zn is linear in 1/z, as in the paper
  bool position_gradient = false;  // x, y move a face's colour and depth at a pixel, too

  std::size_t texels() const {  // of a face
    return texture == SoftTexture::kVertex
               ? 3
               : static_cast<std::size_t>(resolution) * static_cast<std::size_t>(resolution);
  }
  double BackgroundDepth() const { return background_once ? eps : 2 * eps; }  // as a zn
};

// Texel of a face of resolution R at clipped weights w0, w1: x = w0 R, y = w1 R; the upper half of
// a cell is stored mirrored at the face's middle. The last column and row belong to weight 1, and
// rounding on the diagonal to its lower side: published, both are read from elsewhere.
template <class T>
std::size_t SoftTexel(T w0, T w1, int resolution, T tolerance) {
  const T scale = static_cast<T>(resolution);
  const int x = std::min(static_cast<int>(w0 * scale), resolution - 1);
  const int y = std::min(static_cast<int>(w1 * scale), resolution - 1);
  const bool lower = (w0 + w1) * scale - static_cast<T>(x + y) <= T(1) + tolerance;
  return static_cast<std::size_t>(lower ? y * resolution + x
                                        : (resolution - 1 - y) * resolution + resolution - 1 - x);
}

// What the kernel compares and stores instead of zn: -z, or 1/z with inverse_depth. Its differences
// keep digits that (far - z) / (far - near) loses in float.
struct SoftNearness {
  double range;       // between the planes: zn is (nearness - that of far) / range
  double background;  // that of the background
};
inline SoftNearness NearnessOf(const SoftRasOptions& o, const SoftRasColors& c) {
  const double far = c.inverse_depth ? 1 / o.far_plane : -o.far_plane;
  const double near = c.inverse_depth ? 1 / o.near_plane : -o.near_plane;
  return {near - far, far + c.BackgroundDepth() * (near - far)};
}

// What one image keeps between its forward and its backward pass, beside a SoftRasImage: planes of
// [size][stride] as there.
struct SoftRasColorImage {
  AlignedVector<float> nearest;       // the largest SoftNearness that was mixed
  AlignedVector<float> total;         // of weights relative to that of `nearest`
  AlignedVector<float> color;         // [3]
  AlignedVector<std::int32_t> cover;  // kHard: the face, -1: none
  AlignedVector<float> push;          // [4] dL/dI, and its product with I; of the backward pass
};

// What an image is coloured with; after SetUpSoftRas.
struct SoftRasColorJob {
  const SoftRasOptions& options;
  const SoftRasColors& colors;
  const SoftRasImage& image;
  std::span<const float> textures;  // [F,texels,3]
};

// Makes room; before SoftRasColorForward, on one thread.
void ReserveSoftRasColors(const SoftRasImage& image, SoftRasColorImage* mixed);
// color: [3,size,size], of which `rows` are written.
void SoftRasColorForward(const SoftRasColorJob& job, RowRange rows, SoftRasColorImage* mixed,
                         std::span<float> color);

// After SoftRasColorForward of all rows: reads d_color [3,size,size].
void SoftRasColorPrepareBackward(const SoftRasImage& image, std::span<const float> d_color,
                                 SoftRasColorImage* mixed);
struct SoftRasColorAdjoints {
  std::span<float> d_corners;   // [F,3,3], added to
  std::span<float> d_textures;  // [F,texels,3], overwritten
};
// Then for faces [begin, end).
void SoftRasColorBackward(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                          std::size_t begin, std::size_t end, const SoftRasColorAdjoints& out);

}  // namespace tilegrad::rivals

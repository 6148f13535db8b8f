// SPDX-License-Identifier: Apache-2.0
// Colours of SoftRas: at each pixel the faces mix, weighted by their probability and by how near
// they are,
//
//   I = (sum_j D_j e^(zn_j / gamma) C_j + b C_background) / (sum_j D_j e^(zn_j / gamma) + b)
//
// with zn_j = (far - z) / (far - near) of the face at the pixel, b = e^(2 eps / gamma) and C_j
// linear on the image between the colours of the face's corners. What is published and what is
// repaired: docs/training.md.
#pragma once

#include <cstddef>
#include <span>

#include "base/aligned.h"
#include "rivals/softras.h"

namespace tilegrad::rivals {

inline constexpr std::size_t kSoftTexels = 3;  // of a face: the colours of its corners

struct SoftRasColors {
  double gamma = 1e-4;  // > 0
  double eps = 1e-3;    // of the background's weight
  double background[3] = {0, 0, 0};
  // The repair, off in the published form: x, y move a face's colour and depth at a pixel, too.
  bool position_gradient = false;

  double BackgroundDepth() const { return 2 * eps; }  // as a zn
};

// What one image keeps between its forward and its backward pass, beside a SoftRasImage: planes of
// [size][stride] as there.
struct SoftRasColorImage {
  // The largest -z that was mixed: its differences keep digits that those of zn lose in float.
  AlignedVector<float> nearest;
  AlignedVector<float> total;  // of weights relative to that of `nearest`
  AlignedVector<float> color;  // [3]
  AlignedVector<float> push;   // [4] dL/dI, and its product with I; of the backward pass
};

// What an image is coloured with; after SetUpSoftRas.
struct SoftRasColorJob {
  const SoftRasOptions& options;
  const SoftRasColors& colors;
  const SoftRasImage& image;
  std::span<const float> textures;  // [F,3,3]
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
  std::span<float> d_textures;  // [F,3,3], overwritten
};
// Then for faces [begin, end).
void SoftRasColorBackward(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                          std::size_t begin, std::size_t end, const SoftRasColorAdjoints& out);

}  // namespace tilegrad::rivals

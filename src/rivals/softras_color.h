// SPDX-License-Identifier: Apache-2.0
// Colours of SoftRas: each pixel mixes faces weighted by probability and nearness,
//
//   I = (sum_j D_j e^(zn_j / gamma) C_j + b C_background) / (sum_j D_j e^(zn_j / gamma) + b)
//
// with zn_j = (far - z) / (far - near) of the face at the pixel, b = e^(2 eps / gamma) and C_j
// linear on the image between the colours of the face's corners. What is as published and what is
// repaired: docs/training.md.
#pragma once

#include <cstddef>
#include <span>

#include "base/aligned.h"
#include "rivals/softras.h"

namespace tilegrad::rivals {

inline constexpr std::size_t kSoftTexels = 3;  // per face: the colours of its corners

struct SoftRasColors {
  double gamma = 1e-4;  // > 0
  double eps = 1e-3;    // in the background's weight
  double background[3] = {0, 0, 0};
  // A repair, off in the published form: x, y also move a face's colour and depth at a pixel.
  bool position_gradient = false;

  double BackgroundDepth() const { return 2 * eps; }  // as a zn
};

// State of one image between its forward and its backward pass, beside a SoftRasImage: planes of
// [size][stride] as there.
struct SoftRasColorImage {
  // The largest -z mixed: differences of -z keep digits that those of zn lose in float.
  AlignedVector<float> nearest;
  AlignedVector<float> total;  // of weights relative to that of `nearest`
  AlignedVector<float> color;  // [3]
  AlignedVector<float> push;   // [4] dL/dI, and its product with I; backward pass only
};

// Inputs for colouring an image; after SetUpSoftRas.
struct SoftRasColorJob {
  const SoftRasOptions& options;
  const SoftRasColors& colors;
  const SoftRasImage& image;
  std::span<const float> textures;  // [F,3,3]
};

// Allocates; call before SoftRasColorForward, from one thread.
void ReserveSoftRasColors(const SoftRasImage& image, SoftRasColorImage* mixed);
// color: [3,size,size]; writes only `rows`.
void SoftRasColorForward(const SoftRasColorJob& job, RowRange rows, SoftRasColorImage* mixed,
                         std::span<float> color);

// Call after SoftRasColorForward of all rows: reads d_color [3,size,size].
void SoftRasColorPrepareBackward(const SoftRasImage& image, std::span<const float> d_color,
                                 SoftRasColorImage* mixed);
struct SoftRasColorAdjoints {
  std::span<float> d_corners;   // [F,3,3], added to
  std::span<float> d_textures;  // [F,3,3], overwritten
};
// Then call for faces [begin, end).
void SoftRasColorBackward(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                          std::size_t begin, std::size_t end, const SoftRasColorAdjoints& out);

}  // namespace tilegrad::rivals

// SPDX-License-Identifier: Apache-2.0
// Silhouettes of N3MR (H. Kato et al.: Neural 3D Mesh Renderer, CVPR 2018) as its published code
// makes them: a z-buffer, and a hand-made gradient in its place, which moves edges along lines of
// pixels (n3mr_sweep.h). What is published and what is repaired here: docs/training.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "rivals/n3mr_options.h"
#include "rivals/softras.h"

namespace tilegrad::rivals {

// Pixels on the lines of a drawing, ascending.
template <class T>
struct LinePixelsT {
  AlignedVector<std::int32_t> first;  // [inner][inner + 1], see Find
  AlignedVector<T> at, gain;          // position on the line, and how much the loss falls

  // Index of the first pixel of `line` at or beyond `at_least`, of 0 .. inner.
  std::size_t Find(int line, int at_least, int inner) const {
    return static_cast<std::size_t>(first[static_cast<std::size_t>(line * (inner + 1) + at_least)]);
  }
};

// What one image keeps between its forward and its backward pass.
template <class T>
struct N3mrImageT {
  int size = 0, inner = 0;  // pixels a side of the image and of its drawing
  AlignedVector<N3mrFaceT<T>> faces;
  AlignedVector<std::int32_t> drawn_of;   // [F] index into `faces`, -1: not drawn
  AlignedVector<std::int32_t> owner;      // [inner,inner] index into `faces`, -1: none
  AlignedVector<T> inverse_depth;         // [inner,inner]
  AlignedVector<T> coverage, d_coverage;  // [inner,inner]
  // Uncovered pixels that the loss wants covered, by row and by column of the drawing: the only
  // ones that pull an edge outward.
  LinePixelsT<T> pull_rows, pull_columns;
};

// Sets up an image of size x size with faces [F,3,3]. T: float or double, as everything below.
template <class T>
void SetUpN3mr(std::span<const T> corners, int size, const N3mrOptions& options,
               N3mrImageT<T>* image);
// Draws rows [begin, end) of the drawing, of 0 .. image->inner. Faces count in order, so the bits
// do not depend on how rows are shared.
template <class T>
void DrawN3mr(const N3mrOptions& options, RowRange rows, N3mrImageT<T>* image);
// After all rows: alpha [size,size].
template <class T>
void N3mrAlpha(const N3mrOptions& options, N3mrImageT<T>* image, std::span<T> alpha);

// Then the way back: reads d_alpha [size,size].
template <class T>
void N3mrPrepareBackward(const N3mrOptions& options, std::span<const T> d_alpha,
                         N3mrImageT<T>* image);
// For faces [begin, end) as given: writes their hand-made gradient to d_corners [F,3,3]; that of z
// is 0.
template <class T>
void N3mrBackward(const N3mrOptions& options, const N3mrImageT<T>& image, std::size_t begin,
                  std::size_t end, std::span<T> d_corners);

}  // namespace tilegrad::rivals

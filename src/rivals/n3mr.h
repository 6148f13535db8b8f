// SPDX-License-Identifier: Apache-2.0
// Silhouettes of N3MR (H. Kato et al.: Neural 3D Mesh Renderer, CVPR 2018) as in its published
// code: a z-buffer with a hand-crafted gradient, which moves edges along lines of pixels
// (n3mr_sweep.h). What is as published and what is repaired: docs/training.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "rivals/face_corners.h"
#include "rivals/softras.h"

namespace tilegrad::rivals {

// Options of N3MR (H. Kato et al.: Neural 3D Mesh Renderer, CVPR 2018), and the faces that it
// draws. Internally, images have `inner` pixels a side and row 0 at the *bottom*; an image
// coordinate c is p = (c n + n - 1) / 2 in their pixel units, so the centre of pixel i is at i.

// How to reduce a drawing of twice the size to the image.
enum class N3mrReduction {
  kNone,      // drawn at its own size
  kMean,      // mean of 2 x 2 pixels: the renderer's anti-aliasing
  kBilinear,  // samples at k (2 n - 1) / (n - 1) of a drawing enlarged by (2 n - 1) / (2 n - 2):
              // the silhouettes of N3MR's own training code
};

struct N3mrOptions {
  N3mrReduction reduction = N3mrReduction::kMean;
  bool fill_back = true;                     // also draw back faces
  double near_plane = 0.1, far_plane = 100;  // pixels show depths strictly between
  double eps = 1e-3;  // > 0; image units, added to the sweep's distances; of texture lookups
  // A repair, off in the published form, which rounds a line's end toward zero: an edge that ends
  // less than a pixel outside the left or lower border still counts there.
  bool floor_lines = false;

  int Inner(int size) const { return reduction == N3mrReduction::kNone ? size : 2 * size; }
  // The factor on all coordinates. `size` must be at least 2 with kBilinear.
  double Scale(int size) const {
    return reduction == N3mrReduction::kBilinear ? (2.0 * size - 1) / (2.0 * size - 2) : 1.0;
  }
};

// A drawn face: counter-clockwise on the image, if necessary after swapping corners 0 and 2.
template <class T>
struct N3mrFaceT {
  FaceCorners<T> at;
  T area2;  // > 0
  std::int32_t source;
  bool reversed;

  int SourceCorner(int k) const { return reversed ? 2 - k : k; }
};

// Calls add(face) in drawing order, in which the lower index wins a tie: first the faces that are
// counter-clockwise as given, then the others from behind. Skips faces without area, which own no
// pixel.
template <class T, class Add>
void ForN3mrFaces(std::span<const T> corners, const N3mrOptions& options, double scale,
                  const Add& add) {
  const std::size_t faces = corners.size() / kCornerNumbers;
  for (const bool reversed : {false, true}) {
    if (reversed && !options.fill_back) return;
    for (std::size_t f = 0; f < faces; ++f) {
      const FaceCorners<T> given = CornersOf(corners.data(), f);
      if (!IsUsable(given)) continue;
      N3mrFaceT<T> face{{}, T(0), static_cast<std::int32_t>(f), reversed};
      for (int k = 0; k < 3; ++k) {
        const int from = face.SourceCorner(k);
        face.at.x[k] = given.x[from] * static_cast<T>(scale);
        face.at.y[k] = given.y[from] * static_cast<T>(scale);
        face.at.z[k] = given.z[from] * static_cast<T>(scale);
      }
      face.area2 = DoubledArea(face.at);
      if (RealPart(face.area2) > 0) add(face);
    }
  }
}

// Converts to pixel units of the drawing.
template <class T>
T ToInnerPixels(const T& coordinate, int inner) {
  return (coordinate * T(inner) + T(inner - 1)) / T(2);
}

// Pixels on the lines of a drawing, ascending.
template <class T>
struct LinePixelsT {
  AlignedVector<std::int32_t> first;  // [inner][inner + 1], see Find
  AlignedVector<T> at, gain;          // position on the line, and decrease of the loss

  // Index of the first pixel of `line` at or beyond `at_least`, in 0 .. inner.
  std::size_t Find(int line, int at_least, int inner) const {
    return static_cast<std::size_t>(first[static_cast<std::size_t>(line * (inner + 1) + at_least)]);
  }
};

// State of one image between its forward and its backward pass.
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
// Draws rows [begin, end) of the drawing, in 0 .. image->inner. Processes faces in order, so the
// bits do not depend on the division of rows.
template <class T>
void DrawN3mr(const N3mrOptions& options, RowRange rows, N3mrImageT<T>* image);
// Call after all rows: alpha [size,size].
template <class T>
void N3mrAlpha(const N3mrOptions& options, N3mrImageT<T>* image, std::span<T> alpha);

// Starts the backward pass: reads d_alpha [size,size].
template <class T>
void N3mrPrepareBackward(const N3mrOptions& options, std::span<const T> d_alpha,
                         N3mrImageT<T>* image);
// For faces [begin, end) as given: writes their hand-crafted gradient to d_corners [F,3,3]; that of
// z is 0.
template <class T>
void N3mrBackward(const N3mrOptions& options, const N3mrImageT<T>& image, std::size_t begin,
                  std::size_t end, std::span<T> d_corners);

// The pixels of N3MR's drawing that a face may cover, and those that it owns.

// Pixels of the drawing whose centre may lie within the extent of three coordinates. In pixel units
// these round by up to 2^15 2^-24 = 2e-3 in float, at the far end of the largest drawing.
struct InnerRange {
  int begin, end;

  template <class T>
  InnerRange(const T c[3], int inner) {
    const auto pixel = [&](T v) {
      return std::clamp(ToInnerPixels(v, inner), T(-2), static_cast<T>(inner) + 1);
    };
    const T slack = T(4e-3), low = pixel(std::min({c[0], c[1], c[2]})) - slack;
    const T high = pixel(std::max({c[0], c[1], c[2]})) + slack;
    begin = std::max(0, static_cast<int>(std::ceil(low)));
    end = std::min(inner, static_cast<int>(std::floor(high)) + 1);
  }
};

// Calls visit(pixel, column, row) for the pixels of the drawing that faces[f] owns, row 0 at the
// bottom.
template <class T, class Visit>
void ForOwnPixels(const N3mrImageT<T>& image, std::int32_t f, const Visit& visit) {
  const N3mrFaceT<T>& face = image.faces[static_cast<std::size_t>(f)];
  const InnerRange columns(face.at.x, image.inner), rows(face.at.y, image.inner);
  for (int i = rows.begin; i < rows.end; ++i) {
    for (int j = columns.begin; j < columns.end; ++j) {
      const auto p = static_cast<std::size_t>(i * image.inner + j);
      if (image.owner[p] == f) visit(p, j, i);
    }
  }
}

// Faces that own no pixel have no gradient.
template <class T>
bool OwnsAPixel(const N3mrImageT<T>& image, std::int32_t f) {
  int own = 0;
  ForOwnPixels(image, f, [&](std::size_t, int, int) { ++own; });
  return own > 0;
}

}  // namespace tilegrad::rivals

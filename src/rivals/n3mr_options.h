// SPDX-License-Identifier: Apache-2.0
// What N3MR (H. Kato et al.: Neural 3D Mesh Renderer, CVPR 2018) can be asked for, and the faces
// that it draws. Inside, images have `inner` pixels a side and row 0 at the *bottom*; pixel units
// there are p = (c n + n - 1) / 2 of an image coordinate c, so the centre of pixel i is at i.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "rivals/face_corners.h"

namespace tilegrad::rivals {

// How the image is made from a drawing of twice its size.
enum class N3mrReduction {
  kNone,      // it is drawn at its own size
  kMean,      // mean of 2 x 2 pixels: the renderer's anti-aliasing
  kBilinear,  // samples at k (2 n - 1) / (n - 1) of a drawing that is larger by (2 n - 1) / (2 n -
              // 2): the silhouettes of N3MR's own training code
};

struct N3mrOptions {
  N3mrReduction reduction = N3mrReduction::kMean;
  bool fill_back = true;                     // faces are drawn from behind, too
  double near_plane = 0.1, far_plane = 100;  // a pixel shows what lies strictly between
  double eps = 1e-3;  // > 0; image units added to each distance of the sweep; of texture lookups
  // Repair, off in the published form, which rounds a line's end toward zero: an edge that ends
  // less than a pixel outside the left or lower border still counts there.
  bool floor_lines = false;

  int Inner(int size) const { return reduction == N3mrReduction::kNone ? size : 2 * size; }
  // The factor on all coordinates. Size at least 2 with kBilinear.
  double Scale(int size) const {
    return reduction == N3mrReduction::kBilinear ? (2.0 * size - 1) / (2.0 * size - 2) : 1.0;
  }
};

// A face that is drawn: counter-clockwise on the image, if need be by exchanging corners 0 and 2.
template <class T>
struct N3mrFaceT {
  FaceCorners<T> at;
  T area2;  // > 0
  std::int32_t source;
  bool reversed;

  int SourceCorner(int k) const { return reversed ? 2 - k : k; }
};

// Calls add(face) for the faces in the order of drawing, in which the lower wins a tie: those that
// are counter-clockwise as given, then the others from behind. Faces without area are left out:
// they own no pixel.
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

// Pixel units of the drawing.
template <class T>
T ToInnerPixels(const T& coordinate, int inner) {
  return (coordinate * T(inner) + T(inner - 1)) / T(2);
}

}  // namespace tilegrad::rivals

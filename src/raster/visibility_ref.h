// SPDX-License-Identifier: Apache-2.0
// Scalar reference of visibility.h: tests every face at every pixel. T: float, double,
// std::complex<double>.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/scalar.h"
#include "raster/conventions.h"
#include "raster/coverage.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Pixel-independent data of a drawn face.
template <class T>
struct VisibilitySetup {
  std::int32_t face;
  SnappedFace shape;
  DepthPlane<T> depth;
};

template <class T>
std::vector<VisibilitySetup<T>> SetUpDrawnFaces(const ScreenMeshT<T>& mesh) {
  std::vector<VisibilitySetup<T>> out;
  for (std::size_t f = 0; f < mesh.faces(); ++f) {
    if (mesh.reject[f] != kFaceDrawn) continue;
    out.push_back(
        {static_cast<std::int32_t>(f), SnapFaceClockwise(mesh, f), MakeDepthPlane(mesh, f)});
  }
  return out;
}

// Rows [row_begin, row_end): face[i * width + j] <- index into `mesh` of the face visible at pixel
// (j, i), or kNoFace.
template <class T>
void VisibilityRef(const ScreenMeshT<T>& mesh, int row_begin, int row_end,
                   std::span<std::int32_t> face) {
  const auto setups = SetUpDrawnFaces(mesh);
  for (int i = row_begin; i < row_end; ++i) {
    for (int j = 0; j < mesh.width; ++j) {
      auto nearest = RealPart(T(0));
      std::int32_t best = kNoFace;
      for (const auto& setup : setups) {
        if (!Covers(setup.shape, j, i)) continue;
        const auto z = RealPart(setup.depth.At(T(j) + T(0.5), T(i) + T(0.5)));
        if (z > nearest) {
          nearest = z;
          best = setup.face;
        }
      }
      face[static_cast<std::size_t>(i) * mesh.width + j] = best;
    }
  }
}

// The face of `mesh` visible at pixel (column, row), given the face of the caller's mesh: of a cut
// face, the piece that covers the pixel.
template <class T>
std::int32_t PieceAt(const ScreenMeshT<T>& mesh, std::int32_t source_face, int column, int row) {
  if (source_face < 0 || !mesh.was_clipped()) return source_face;
  const auto& ids = mesh.source_face;
  const auto first =
      static_cast<std::size_t>(std::lower_bound(ids.begin(), ids.end(), source_face) - ids.begin());
  const bool two = first + 1 < ids.size() && ids[first + 1] == source_face;
  const bool second = two && (mesh.reject[first] != kFaceDrawn ||
                              !Covers(SnapFaceClockwise(mesh, first), column, row));
  return static_cast<std::int32_t>(first + (second ? 1 : 0));
}

}  // namespace tilegrad::raster

// SPDX-License-Identifier: Apache-2.0
// The fourth of nvdiffrast's operations (rasterize.h): smooth silhouettes, which give visibility a
// gradient (Laine et al. 2020, section 3.5).
//
// Tests every pair of horizontally or vertically adjacent pixels that show different faces,
// following the nearer face from its pixel's centre to the other's. If it ends in between, at t in
// [0, 1], at a silhouette edge (no other face continues behind it) at more than 45 degrees to that
// direction:
//
//     t < 1/2   the face ends within its own pixel, which takes 1/2 - t of the other's colour
//     t >= 1/2  it reaches into the other pixel, which takes t - 1/2 of the face's colour
//
// Pairs in the other direction handle edges at less than 45 degrees. t moves with the ends of the
// edge: that is the gradient of coverage. An edge whose face is visible in no pixel beside it is
// missed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

// Edge adjacency of faces, by vertex indices.

// Side 3 f + k of face f leads from its corner k to the next one, opposite the third. The sides of
// one edge form a ring: next[side] is another side of the same edge, or the side itself at a
// boundary. A ring includes all faces of its edge, however many.
struct EdgeRings {
  std::vector<std::int32_t> next;  // [3 F]
};

EdgeRings BuildEdgeRings(FaceList faces);

template <class T>
struct AntialiasInput {
  VertexRows<T> positions;  // [N,V,4] or [V,4], as passed to rasterize
  FaceList faces;           // [F,3]
  const EdgeRings* rings;   // of `faces`
  PixelGrid grid;
  std::span<const T> rast;   // [N,H,W,4] from rasterize
  std::span<const T> color;  // [N,H,W,C]
  std::size_t channels = 0;
};

// out [N,H,W,C]. Errors: rings of other faces, an index out of range.
template <class T>
Status Antialias(const AntialiasInput<T>& input, const Workers& workers, std::span<T> out);

// Overwritten; empty ones are not computed.
template <class T>
struct AntialiasGradients {
  std::span<T> d_color;      // [N,H,W,C]
  std::span<T> d_positions;  // [N,V,4] or [V,4]; z has no gradient
};

template <class T>
Status AntialiasBackward(const AntialiasInput<T>& input, std::span<const T> d_out,
                         const Workers& workers, const AntialiasGradients<T>& out);

}  // namespace tilegrad::compat::nvdiffrast

// SPDX-License-Identifier: Apache-2.0
// The fourth of nvdiffrast's operations (rasterize.h): smooth silhouettes, and with them gradients
// of what is seen (Laine et al. 2020, section 3.5).
//
// Every two pixels next to each other, beside or above, that show different faces are looked at.
// The nearer of the two faces is followed from its pixel's centre to the other's. If it ends on the
// way at an edge that is a silhouette (no other face goes on behind it) and is at more than 45
// degrees to the way, then at t in [0, 1]:
//
//     t < 1/2   the face ends within its own pixel, which takes 1/2 - t of the other's colour
//     t >= 1/2  it reaches into the other pixel, which takes t - 1/2 of the face's colour
//
// Edges at less than 45 degrees are met by the pairs in the other direction. t moves with the ends
// of the edge: that is the gradient of coverage. An edge whose face shows in no pixel beside it is
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

// Which faces share an edge, by the indices of its two vertices.

// Side 3 f + k of face f goes from its corner k to the next one, and is opposite to the third. The
// sides of one edge form a ring: next[side] is another side of the same edge, or the side itself at
// a boundary. However many faces share the edge, all of them are in its ring.
struct EdgeRings {
  std::vector<std::int32_t> next;  // [3 F]
};

EdgeRings BuildEdgeRings(FaceList faces);

template <class T>
struct AntialiasInput {
  VertexRows<T> positions;  // [N,V,4] or [V,4], as they were rasterized
  FaceList faces;           // [F,3]
  const EdgeRings* rings;   // of `faces`
  PixelGrid grid;
  std::span<const T> rast;   // [N,H,W,4] of rasterize
  std::span<const T> color;  // [N,H,W,C]
  std::size_t channels = 0;
};

// out [N,H,W,C]. Errors: rings of other faces, an index outside of its array.
template <class T>
Status Antialias(const AntialiasInput<T>& input, const Workers& workers, std::span<T> out);

// Overwritten; what is empty is not computed.
template <class T>
struct AntialiasGradients {
  std::span<T> d_color;      // [N,H,W,C]
  std::span<T> d_positions;  // [N,V,4] or [V,4]; z pulls nothing
};

template <class T>
Status AntialiasBackward(const AntialiasInput<T>& input, std::span<const T> d_out,
                         const Workers& workers, const AntialiasGradients<T>& out);

}  // namespace tilegrad::compat::nvdiffrast

// SPDX-License-Identifier: Apache-2.0
// The result of projection: a mesh on the screen of one camera, as a structure of arrays, and its
// gradient.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"

namespace tilegrad::raster {

// A vertex made by near clipping, on an edge of the source mesh: p = (1 - t) * a + t * b. a is the
// visible end, b the hidden one.
template <class T>
struct ClipVertexT {
  std::int32_t a, b;  // source vertices
  T t;
};

// A vertex for kernels that process one vertex at a time: one load instead of four.
template <class T>
struct PackedVertexT {
  T x, y, inverse_depth, depth;
};

// Views over scratch that belongs to the renderer; valid for one frame. V and F count the vertices
// and faces *after* near clipping: clipping appends vertices and replaces a cut face in place by
// one or two, which keep the id of their source. Screen coordinates are pixels: x right from the
// left edge, y down from the top edge. Source vertices nearer than the near plane have x = y =
// inverse_depth = 0 and belong to kFaceBehind faces only.
template <class T>
struct ScreenMeshT {
  std::span<const T> x, y;                   // [V] pixels
  std::span<const T> depth;                  // [V] -p_cam.z; >= near plane where a face is drawn
  std::span<const T> inverse_depth;          // [V] 1 / depth
  std::span<const PackedVertexT<T>> packed;  // [V] the same numbers, interleaved
  std::span<const std::int32_t> v0, v1, v2;  // [F] vertex indices
  // [F] the face of the caller's mesh, ascending; equals the index if nothing was clipped.
  std::span<const std::int32_t> source_face;
  // [V - source_vertices] origins of the appended vertices; empty if nothing was clipped.
  std::span<const ClipVertexT<T>> clipped;
  std::span<const std::uint8_t> reject;  // [F] bits of FaceReject; 0 is drawn
  std::int32_t source_vertices = 0;
  std::int32_t source_faces = 0;
  int width = 0, height = 0;  // pixels

  std::size_t vertices() const { return x.size(); }
  std::size_t faces() const { return v0.size(); }
  bool was_clipped() const { return !clipped.empty(); }
  std::int32_t vertex(std::size_t face, int corner) const {
    return corner == 0 ? v0[face] : corner == 1 ? v1[face] : v2[face];
  }
};
using ScreenMesh = ScreenMeshT<float>;

enum FaceReject : std::uint8_t {
  kFaceDrawn = 0,
  kFaceBehind = 1,      // entirely nearer than the near plane: no pixel, no soft mask
  kFaceDegenerate = 2,  // zero area on the screen: no pixel; takes part in the soft mask as a
                        // segment or point
  kFaceCulled = 4,      // faces away and culling is on: no pixel; takes part in the soft mask
  kFaceOverflow = 8,    // a vertex projects to infinity: no pixel, no soft mask
};
inline constexpr std::uint8_t kFaceNotInSoftMask = kFaceBehind | kFaceOverflow;

// The faces of a ScreenMesh, [F] each.
struct FaceCorners {
  AlignedVector<std::int32_t> v0, v1, v2, source_face;
};

// The memory behind a ScreenMesh, except for its faces if none was clipped and they are shared
// (`whole`). Reused from frame to frame.
template <class T>
struct ScreenMeshBuffersT : FaceCorners {
  AlignedVector<T> x, y, depth, inverse_depth;
  AlignedVector<PackedVertexT<T>> packed;
  const FaceCorners* whole = nullptr;  // shared faces, replacing our own
  AlignedVector<ClipVertexT<T>> clipped;
  AlignedVector<std::uint8_t> reject;
  std::int32_t source_vertices = 0, source_faces = 0;
  int width = 0, height = 0;

  ScreenMeshT<T> View() const {
    const FaceCorners& f = whole != nullptr ? *whole : *this;
    return {
        x,       y,      depth,           inverse_depth, packed, f.v0,  f.v1, f.v2, f.source_face,
        clipped, reject, source_vertices, source_faces,  width,  height};
  }
  // Fills vertices [begin, end) of `packed` from the other arrays.
  void Pack(std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) packed[v] = {x[v], y[v], inverse_depth[v], depth[v]};
  }
};
using ScreenMeshBuffers = ScreenMeshBuffersT<float>;

// dL/d(ScreenMesh); every producer of a gradient adds to it.
template <class T>
struct ScreenGradientsT {
  std::span<T> d_x, d_y;         // [V] per pixel
  std::span<T> d_inverse_depth;  // [V]
  std::span<T> d_clip_t;         // [V - source_vertices] through attributes interpolated at the cut
};
using ScreenGradients = ScreenGradientsT<float>;

}  // namespace tilegrad::raster

// SPDX-License-Identifier: Apache-2.0
// What `project` hands on: a mesh on the screen of one camera, as structure of arrays.
#pragma once

#include <cstdint>
#include <span>

namespace tilegrad::raster {

// Views over scratch that belongs to the renderer; valid for one frame. V and F count the vertices
// and faces *after* near clipping: clipping appends vertices and replaces a cut face by one or two,
// which keep the identity of their source. Screen coordinates are pixels: x right from the left
// edge, y down from the top edge.
template <class T>
struct ScreenMeshT {
  std::span<const T> x, y;                   // [V] pixels
  std::span<const T> depth;                  // [V] -p_cam.z, >= near plane
  std::span<const T> inverse_depth;          // [V] 1 / depth
  std::span<const std::int32_t> v0, v1, v2;  // [F] vertex indices
  std::span<const std::int32_t>
      source_face;  // [F] the face of the caller's mesh; equals the index where nothing was clipped
  // A clipped vertex lies on an edge of the source mesh: p = (1 - t) * a + t * b. For the others, a
  // = b = own index and t = 0.
  std::span<const std::int32_t> clip_a, clip_b;  // [V] source vertices
  std::span<const T> clip_t;                     // [V]
  // Per face: bits of FaceReject; 0 is drawn.
  std::span<const std::uint8_t> reject;  // [F]
  int width = 0, height = 0;             // pixels
};
using ScreenMesh = ScreenMeshT<float>;

enum FaceReject : std::uint8_t {
  kFaceDrawn = 0,
  kFaceBehind = 1,      // wholly nearer than the near plane
  kFaceDegenerate = 2,  // zero area on the screen: no pixel; still takes part in the soft mask,
                        // where it is a segment or point
  kFaceCulled =
      4,  // faces away and culling is on: no pixel; still takes part in the soft mask (spec 1.4)
};

}  // namespace tilegrad::raster

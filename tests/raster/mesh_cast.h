// SPDX-License-Identifier: Apache-2.0
// The same screen mesh in other numbers.
#pragma once

#include "raster/screen_mesh.h"

namespace tilegrad::raster {

template <class To, class From>
ScreenMeshBuffersT<To> MeshCast(const ScreenMeshBuffersT<From>& m) {
  ScreenMeshBuffersT<To> out;
  out.x.assign(m.x.begin(), m.x.end());
  out.y.assign(m.y.begin(), m.y.end());
  out.depth.assign(m.depth.begin(), m.depth.end());
  out.inverse_depth.assign(m.inverse_depth.begin(), m.inverse_depth.end());
  out.v0 = m.v0;
  out.v1 = m.v1;
  out.v2 = m.v2;
  out.source_face = m.source_face;
  for (const auto& c : m.clipped) out.clipped.push_back({c.a, c.b, To(c.t)});
  out.reject = m.reject;
  out.source_vertices = m.source_vertices;
  out.source_faces = m.source_faces;
  out.width = m.width;
  out.height = m.height;
  return out;
}

}  // namespace tilegrad::raster

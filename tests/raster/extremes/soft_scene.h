// SPDX-License-Identifier: Apache-2.0
// From a projected mesh to the scenes of the soft mask's own tests, and so to their truth.
#pragma once

#include <cstddef>

#include "raster/soft_mask/test_util.h"
#include "tilegrad/options.h"

namespace tilegrad::test {

using raster::test::SoftScene;
using raster::test::SoftTruth;

// The faces that take part in alpha.
inline SoftScene SoftSceneOf(const raster::ScreenMeshBuffers& mesh, const RenderOptions& options) {
  SoftScene out;
  out.Resize(options.width, options.height);
  out.options.delta = options.delta;
  out.options.max_alpha_error = options.max_alpha_error;
  out.mesh.x = mesh.x;
  out.mesh.y = mesh.y;
  for (std::size_t f = 0; f < mesh.v0.size(); ++f) {
    if ((mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
    out.mesh.v0.push_back(mesh.v0[f]);
    out.mesh.v1.push_back(mesh.v1[f]);
    out.mesh.v2.push_back(mesh.v2[f]);
    out.mesh.reject.push_back(mesh.reject[f]);
  }
  out.options.faces = out.mesh.v0.size();
  return out;
}

}  // namespace tilegrad::test

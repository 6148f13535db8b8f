// SPDX-License-Identifier: Apache-2.0
// Scenes at the limits of float, and ones that rasterizers get wrong. A scene is a pure function of
// its number.
#pragma once

#include <cstddef>
#include <cstdint>

#include "raster/soft_mask/test_util.h"
#include "render/pipeline/test_scenes.h"
#include "tilegrad/options.h"

namespace tilegrad::test {

struct ExtremeScene {
  const char* kind = "";
  TestScene<float> scene;
  RenderOptions options;

  std::size_t pixels() const {
    return static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  }
};

// `most_faces`: how many may lie on one pixel (kind "heap").
ExtremeScene MakeExtremeScene(std::uint64_t number, std::size_t most_faces);
// So many faces on one pixel, of an image of a few.
ExtremeScene MakeHeap(std::uint64_t number, std::size_t faces);

// From a projected mesh to the scenes of the soft mask's own tests, and so to their truth.

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

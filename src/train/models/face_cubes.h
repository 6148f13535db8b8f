// SPDX-License-Identifier: Apache-2.0
// Maps of a sphere as N3MR's texture cubes of 2 x 2 x 2 texels a face, and back: one network for
// both renderers.
#pragma once

#include <span>
#include <vector>

#include "nn/ops.h"
#include "scene/mesh.h"

namespace tilegrad::train {

class FaceCubes {
 public:
  static constexpr std::int64_t kTexels = 8;  // of a face; texel (i, j, k) is number 4 i + 2 j + k

  FaceCubes() = default;
  // `sphere` with SphereUvs; maps are side x side.
  FaceCubes(nn::Context& context, const Mesh& sphere, int side);

  // textures [B,side,side,3] -> [B,F,8,3]: as N3MR's loader, bilinear samples at barycentric
  // coordinates (i, j, k) / (i + j + k), and at the middle for (0, 0, 0).
  nn::Var Cubes(const nn::Var& textures) const;
  // [B,F,8,3] -> [B,side,side,3]: what N3MR would show at each texel's place.
  nn::Var Maps(const nn::Var& cubes) const;

 private:
  std::int64_t side_ = 0, faces_ = 0;
  nn::AxisMap to_cubes_, to_maps_;  // of [side side] and of [8 F]
};

// positions [N,V,3], directions [N,3] in the world -> [N,F,1,1]: ambient + max(0, n.d) with each
// face's outward normal n, as N3MR lights faces.
nn::Var FaceLight(const nn::Var& positions, const std::vector<Face>& faces,
                  const nn::Var& directions, double ambient);

}  // namespace tilegrad::train

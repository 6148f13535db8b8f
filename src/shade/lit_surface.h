// SPDX-License-Identifier: Apache-2.0
// A mesh with materials under a fixed light: what to interpolate over its faces, and the colour of
// a point from that.
//
// Light, fixed in the world, so that a point has one colour in all views: Lambert with ambient
// 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a fill light of 0.2 from (-0.6, 0.3, -0.75),
// both directions normalised; results above 1 are cut. Surfaces are two-sided, since real models
// are soups of shells: the normal is turned to the side that the eye sees.
#pragma once

#include <array>
#include <vector>

#include "scene/mesh.h"
#include "shade/surface_color.h"

namespace tilegrad::shade {

// Keeps a reference to the mesh, which is valid.
class LitSurface {
 public:
  static constexpr std::size_t kChannels = 8;  // uv, normal, vertex colour
  using Sample = std::array<float, kChannels>;

  explicit LitSurface(const Mesh& mesh);

  const std::vector<float>& attributes() const { return attributes_; }  // [F,3,kChannels]
  // RGB in [0, 1] of a point of a face with these interpolated attributes, seen from `eye`.
  glm::vec3 Shade(std::size_t face, const Sample& sample, glm::vec3 eye) const;

 private:
  const Mesh& mesh_;
  SurfaceColor color_;
  std::vector<glm::vec3> face_normals_;  // not normalised
  std::vector<float> attributes_;
};

}  // namespace tilegrad::shade

// SPDX-License-Identifier: Apache-2.0
// The sphere that every prediction is a deformation of, and the numbers that deform it.
#pragma once

#include <cstdint>

#include "nn/tape.h"
#include "scene/mesh.h"
#include "train/models/offset_map.h"

namespace tilegrad::train {

inline constexpr float kPredictionHalfExtent = 0.45f;  // world units, as the truth

struct TemplateConfig {
  std::int64_t level = 3;      // subdivisions of the icosahedron: 3 gives 642 vertices
  double radius = 0.175;       // world units
  std::int64_t smoothing = 0;  // rounds of diffusion over the sphere that offsets go through
  bool symmetric = false;  // offsets are the mean of themselves and their mirror image at x = 0,
                           // so every prediction is symmetric there
  bool n3mr_vertices = false;  // sphere_vertices.h instead of offsets; radius is 1/4, and the two
                               // keys above do not apply
};

class DeformableTemplate {
 public:
  // `context` outlives it.
  DeformableTemplate(nn::Context& context, const TemplateConfig& config);

  const Mesh& mesh() const { return mesh_; }
  std::int64_t vertices() const { return static_cast<std::int64_t>(mesh_.positions.size()); }
  // That deform one sphere: three for each vertex and, in N3MR's form, three for all.
  std::int64_t numbers() const { return 3 * vertices() + (config_.n3mr_vertices ? 3 : 0); }

  // raw [B, numbers()] -> offsets [B, V, 3] from the sphere; those of 0 are 0.
  nn::Var Movement(const nn::Var& raw) const;
  // The sphere moved; bounding box centred, largest half-extent kPredictionHalfExtent.
  nn::Var Positions(const nn::Var& movement) const;

 private:
  nn::Var N3mrMovement(const nn::Var& raw) const;

  nn::Context& context_;
  TemplateConfig config_;
  Mesh mesh_;
  nn::Tensor positions_;    // [V, 3]
  nn::Tensor unit_sphere_;  // [V, 3] at radius 1; n3mr_vertices
  OffsetMap offsets_;       // without n3mr_vertices
};

// positions - centre of the bounding box, scaled so that the largest coordinate is half_extent; per
// mesh of [B, V, 3]. The gradient flows through the extremes. A mesh without extent stays finite.
nn::Var NormalizeMeshes(const nn::Var& positions, double half_extent);

}  // namespace tilegrad::train

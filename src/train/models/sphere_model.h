// SPDX-License-Identifier: Apache-2.0
// The sphere that every prediction deforms, and how a network's outputs deform it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "nn/nn.h"
#include "nn/ops.h"
#include "scene/mesh.h"
#include "scene/topology.h"
#include "train/models/render_op.h"

namespace tilegrad::train {

inline constexpr float kPredictionHalfExtent = 0.45f;  // world units, of CameraRule's defaults

struct SphereConfig {
  std::int64_t level = 3;      // subdivisions of the icosahedron: 3 gives 642 vertices
  double radius = 0.3;         // world units
  std::int64_t smoothing = 4;  // rounds of diffusion over the sphere that smooth offsets
  bool symmetric = true;  // averages offsets with their mirror image at x = 0, so every prediction
                          // is symmetric there
  bool n3mr_vertices = false;  // SphereVertices instead of offsets; radius is 1/4, and the two
                               // keys above do not apply
  // Half-extent of normalised shapes, world units: that of the dataset's objects (CameraRule). Not
  // a key: the data or the checkpoint sets it.
  double half_extent = 0.45;
};

class SphereModel {
 public:
  // `context` outlives it.
  SphereModel(nn::Context& context, const SphereConfig& config);

  const Mesh& mesh() const { return mesh_; }
  const Topology& topology() const { return topology_; }
  std::span<const std::int32_t> faces() const {  // [F, 3]
    return {mesh_.faces[0].data(), 3 * mesh_.faces.size()};
  }
  const std::vector<glm::vec2>& corner_uvs() const { return uvs_; }  // [3 F], longitude, latitude
  std::span<const float> uvs() const { return {&uvs_[0].x, 2 * uvs_.size()}; }  // [F, 3, 2]
  std::int64_t vertices() const { return static_cast<std::int64_t>(mesh_.positions.size()); }
  // The numbers that deform one sphere: three for each vertex and, with n3mr_vertices, three for
  // all.
  std::int64_t numbers() const { return 3 * vertices() + (config_.n3mr_vertices ? 3 : 0); }

  // raw [B, numbers()] -> offsets [B, V, 3] from the sphere; 0 for raw = 0.
  nn::Var Movement(const nn::Var& raw) const;
  nn::Var Positions() const;  // of the sphere, [V, 3]
  // Movement [B, V, 3] to positions, NormalizeMeshes to SphereConfig::half_extent.
  nn::Var Normalized(const nn::Var& movement) const;

  // The job that draws deformed spheres, textured or not: faces, uvs and wrap. Refers to the model.
  RenderJob Job(const RenderOptions& options) const {
    return {.faces = faces(),
            .cameras = {},
            .options = options,
            .uvs = uvs(),
            .wrap = Wrap::kRepeatClamp};
  }

 private:
  nn::Var Mapped(const nn::Var& raw) const;
  nn::Var N3mrMovement(const nn::Var& raw) const;

  nn::Context& context_;
  SphereConfig config_;
  Mesh mesh_;
  Topology topology_;
  std::vector<glm::vec2> uvs_;
  nn::Tensor positions_;    // [V, 3]
  nn::Tensor unit_sphere_;  // [V, 3] at radius 1; n3mr_vertices
  nn::AxisMap diffusion_;   // one round; without n3mr_vertices
  nn::AxisMap symmetry_;    // of [3 V] offsets
};

// positions - centre of the bounding box, scaled so that the largest coordinate is half_extent; per
// mesh of [B, V, 3]. The gradient flows through the extremes. A mesh without extent stays finite.
nn::Var NormalizeMeshes(const nn::Var& positions, double half_extent);

// Averages the columns of a map of the sphere with their mirror image at x = 0, which is at 1/2 - u
// (scene/shapes.h): column W/2 - 1 - i for column i.
nn::AxisMap MirrorColumns(nn::Context& context, std::int64_t width);

// Vertices as N3MR's training code parameterises them (and SoftRas's after it): each coordinate
// keeps its sign and moves between 0 and the side of a cube, then a centroid moves within it.
// With s = `sphere` [V,3], of unit radius, bias [B,V,3] and centroid [B,1,3]:
//
//   u = sign(s) sigmoid(logit(|s| / 2) + bias),   c = tanh(0.1 centroid),
//   v = max(u, 0) (1 - c) - max(-u, 0) (1 + c) + c
//
// Returns v / 2 [B,V,3], within (-1/2, 1/2); s / 4 where bias and centroid are 0. As published, a
// coordinate where s is 0 has u = 0 whatever its bias, without a gradient.
nn::Var SphereVertices(const nn::Var& bias, const nn::Var& centroid, const nn::Tensor& sphere);

// What networks predict from pictures, and generators from noise.

// For a batch of B. What a network does not predict is an invalid Var. Light is in the axes of each
// picture's camera.
struct Prediction {
  nn::Var movement{};    // [B, V, 3] from what is deformed, before normalisation
  nn::Var positions{};   // [B, V, 3]
  nn::Var colors{};      // [B, V, 3] linear, not clamped
  nn::Var textures{};    // [B, h, h, 3] in [0, 1], by the sphere's longitude and latitude
  nn::Var flow{};        // [B, 2, h, w] in [-1, 1] (nn/ops.h)
  nn::Var directions{};  // [B, 3] unit, to the light; Lambert and Phong
  nn::Var shininess{};   // [B]; Phong
  nn::Var sh{};          // [B, 9]; harmonics
  nn::Var pose{};        // [B, 10] Pose of the picture's camera (picture_lookup.h)
  nn::Var cameras{};     // [B, 7] (camera_ops.h), quaternions unit
  // For a network that predicts N cameras per picture: all of them (`cameras` holds the likeliest),
  // and their logits.
  nn::Var camera_choices{};  // [B N, 7]
  nn::Var choice_logits{};   // [B, N]
  nn::Var keypoints{};       // [B, K, 3]
};

// Item i as a deformed `sphere`, with its texture, if any, and its colours, if any, clamped to [0,
// 1]. An error if it is not valid.
Result<Mesh> MeshOf(const SphereModel& sphere, const Prediction& prediction, std::size_t i);

// [B][4][size][size] bytes as networks take them: [B, 4, size, size] in [0, 1].
nn::Tensor InputOf(nn::Context& context, std::span<const std::uint8_t> images, int size);

// Item i of a batch [B, ...].
inline std::span<const float> ItemOf(const nn::Var& batch, std::size_t i) {
  const std::span<const float> all = batch.value().span<float>();
  const std::size_t size = all.size() / static_cast<std::size_t>(batch.shape()[0]);
  return all.subspan(i * size, size);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/models/deformable_template.h"

#include <map>
#include <tuple>
#include <vector>

#include "nn/nn.h"
#include "scene/shapes.h"
#include "scene/topology.h"
#include "train/models/sphere_vertices.h"

namespace tilegrad::train {
namespace {

// A quarter of the unit sphere is what N3MR's vertices start from.
constexpr double kN3mrRadius = 0.25;

// One round of diffusion over a mesh: each vertex goes halfway to the mean of its neighbours. Noise
// from vertex to vertex dies out with the rounds, and what is smooth stays.
nn::AxisMap DiffusionRound(const nn::Var& like, const Mesh& mesh) {
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  const auto vertices = static_cast<std::int64_t>(mesh.positions.size());
  return nn::MakeAxisMap(like, {vertices, vertices}, [&](std::int64_t v, nn::AxisTerms& terms) {
    const auto at = topology.offsets.begin() + v;
    terms.push_back({v, 0.5});
    for (std::int32_t n = at[0]; n < at[1]; ++n)
      terms.push_back({topology.neighbors[static_cast<std::size_t>(n)], 0.5 / (at[1] - at[0])});
  });
}

// (I + lambda L)^-1 [V, V] with L = D - A of the mesh's edges: by Gauss and Jordan, without pivots,
// as the matrix is diagonally dominant.
std::vector<double> StiffInverse(const Mesh& mesh, double lambda) {
  const std::size_t n = mesh.positions.size();
  const Topology topology = BuildTopology(mesh.faces, n);
  std::vector<double> a(n * n);
  for (std::size_t v = 0; v < n; ++v) {
    const std::int32_t first = topology.offsets[v], last = topology.offsets[v + 1];
    a[v * n + v] = 1 + lambda * (last - first);
    for (std::int32_t i = first; i < last; ++i)
      a[v * n + static_cast<std::size_t>(topology.neighbors[static_cast<std::size_t>(i)])] = -lambda;
  }
  for (std::size_t k = 0; k < n; ++k) {
    double* const pivot = &a[k * n];
    const double scale = 1 / pivot[k];
    pivot[k] = 1;
    for (std::size_t j = 0; j < n; ++j) pivot[j] *= scale;
    for (std::size_t i = 0; i < n; ++i) {
      const double factor = a[i * n + k];
      if (i == k || factor == 0) continue;
      a[i * n + k] = 0;
      for (std::size_t j = 0; j < n; ++j) a[i * n + j] -= factor * pivot[j];
    }
  }
  return a;
}

// The vertex at (-x, y, z) for each vertex of a sphere whose mirrored coordinates have equal bits.
std::vector<std::int64_t> MirrorVertices(const Mesh& sphere) {
  std::map<std::tuple<float, float, float>, std::int64_t> at;
  for (std::size_t v = 0; v < sphere.positions.size(); ++v) {
    const glm::vec3& p = sphere.positions[v];
    at[{p.x, p.y, p.z}] = static_cast<std::int64_t>(v);
  }
  std::vector<std::int64_t> mirror;
  for (const glm::vec3& p : sphere.positions) mirror.push_back(at.at({-p.x, p.y, p.z}));
  return mirror;
}

// Offsets [3 V] to the mean of themselves and their mirror image at x = 0, a projection.
nn::AxisMap Symmetry(const nn::Var& like, const Mesh& sphere) {
  const std::vector<std::int64_t> mirror = MirrorVertices(sphere);
  const auto numbers = 3 * static_cast<std::int64_t>(mirror.size());
  return nn::MakeAxisMap(like, {numbers, numbers}, [&](std::int64_t i, nn::AxisTerms& terms) {
    const std::int64_t axis = i % 3, other = 3 * mirror[static_cast<std::size_t>(i / 3)] + axis;
    terms.push_back({i, 0.5});
    terms.push_back({other, axis == 0 ? -0.5 : 0.5});
  });
}

}  // namespace

DeformableTemplate::DeformableTemplate(nn::Context& context, const TemplateConfig& config)
    : context_(context),
      config_(config),
      mesh_(Icosphere(static_cast<int>(config.level),
                      static_cast<float>(config.n3mr_vertices ? kN3mrRadius : config.radius))) {
  const auto count = static_cast<std::int64_t>(mesh_.positions.size());
  const std::span<const float> flat(&mesh_.positions[0].x, 3 * mesh_.positions.size());
  positions_ = context.From({count, 3}, flat);
  std::vector<float> unit(flat.begin(), flat.end());
  for (float& x : unit) x /= static_cast<float>(kN3mrRadius);
  if (config.n3mr_vertices) unit_sphere_ = context.From({count, 3}, std::span<const float>(unit));
  const nn::Var like = nn::Constant(context, positions_);
  diffusion_ = DiffusionRound(like, mesh_);
  if (config.stiffness > 0) {
    const std::vector<double> inverse = StiffInverse(mesh_, config.stiffness);
    stiff_ = context.From({count, count}, std::span<const double>(inverse));
  }
  if (config.symmetric) symmetry_ = Symmetry(like, mesh_);
}

nn::Var DeformableTemplate::Movement(const nn::Var& raw) const {
  if (config_.n3mr_vertices) return N3mrMovement(raw);
  const bool mapped = config_.symmetric || config_.smoothing > 0 || config_.stiffness > 0;
  return nn::Reshape(mapped ? nn::Transpose(Smoothed(raw)) : raw, {raw.shape()[0], vertices(), 3});
}

// [3 V, B] of [B, 3 V]: with the batch last, lanes run over it.
nn::Var DeformableTemplate::Smoothed(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0];
  nn::Var movement = nn::Transpose(raw);
  if (config_.symmetric) movement = nn::MapAxis(movement, 0, symmetry_);
  movement = nn::Reshape(movement, {vertices(), 3 * batch});
  for (std::int64_t round = 0; round < config_.smoothing; ++round)
    movement = nn::MapAxis(movement, 0, diffusion_);
  if (config_.stiffness > 0)
    movement = nn::Matmul(nn::Constant(context_, stiff_), movement);
  return nn::Reshape(movement, {3 * vertices(), batch});
}

// The last three numbers are the centroid. Published, its layer learns at a tenth of the rate.
// Adam's steps do not depend on a factor behind the layer, so a factor of a tenth does the same.
nn::Var DeformableTemplate::N3mrMovement(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0];
  const nn::Var bias = nn::Reshape(nn::Slice(raw, 1, 0, 3 * vertices()), {batch, vertices(), 3});
  const nn::Var centroid =
      nn::Reshape(nn::Slice(raw, 1, 3 * vertices(), 3 * vertices() + 3), {batch, 1, 3});
  return SphereVertices(bias, 0.1 * centroid, unit_sphere_) - nn::Constant(context_, positions_);
}

nn::Var DeformableTemplate::Positions(const nn::Var& movement) const {
  return NormalizeMeshes(movement + nn::Constant(context_, positions_), kPredictionHalfExtent);
}

nn::Var NormalizeMeshes(const nn::Var& positions, double half_extent) {
  constexpr double kTiny =
      1e-12;  // a mesh that collapsed to a point stays there instead of becoming NaN
  const nn::Var centre = 0.5 * (nn::ReduceMax(positions, {1}, nn::Keep::kYes) +
                                nn::ReduceMin(positions, {1}, nn::Keep::kYes));
  const nn::Var centred = positions - centre;
  const nn::Var largest = nn::ReduceMax(nn::Abs(centred), {1, 2}, nn::Keep::kYes);
  return half_extent * centred / (largest + kTiny);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/models/offset_map.h"

#include <map>
#include <tuple>
#include <vector>

#include "nn/nn.h"
#include "scene/topology.h"

namespace tilegrad::train {
namespace {

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
      a[v * n + static_cast<std::size_t>(topology.neighbors[static_cast<std::size_t>(i)])] =
          -lambda;
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

OffsetMap::OffsetMap(nn::Context& context, const Mesh& sphere, const OffsetRules& rules)
    : context_(&context),
      rules_(rules),
      vertices_(static_cast<std::int64_t>(sphere.positions.size())) {
  const nn::Var like = nn::Constant(context, 0.0);
  diffusion_ = DiffusionRound(like, sphere);
  if (rules.symmetric) symmetry_ = Symmetry(like, sphere);
  if (rules.stiffness > 0) {
    const std::vector<double> inverse = StiffInverse(sphere, rules.stiffness);
    stiff_ = context.From({vertices_, vertices_}, std::span<const double>(inverse));
  }
}

nn::Var OffsetMap::Apply(const nn::Var& raw) const {
  if (!raw.valid()) return raw;
  const bool plain = !rules_.symmetric && rules_.smoothing == 0 && rules_.stiffness == 0;
  return nn::Reshape(plain ? raw : Mapped(raw), {raw.shape()[0], vertices_, 3});
}

// With the batch last, so that lanes run over it.
nn::Var OffsetMap::Mapped(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0];
  nn::Var offsets = nn::Transpose(raw);
  if (rules_.symmetric) offsets = nn::MapAxis(offsets, 0, symmetry_);
  offsets = nn::Reshape(offsets, {vertices_, 3 * batch});
  for (std::int64_t round = 0; round < rules_.smoothing; ++round)
    offsets = nn::MapAxis(offsets, 0, diffusion_);
  if (rules_.stiffness > 0) offsets = nn::Matmul(nn::Constant(*context_, stiff_), offsets);
  return nn::Transpose(nn::Reshape(offsets, {3 * vertices_, batch}));
}

}  // namespace tilegrad::train

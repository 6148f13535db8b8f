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
    : rules_(rules), vertices_(static_cast<std::int64_t>(sphere.positions.size())) {
  const nn::Var like = nn::Constant(context, 0.0);
  diffusion_ = DiffusionRound(like, sphere);
  if (rules.symmetric) symmetry_ = Symmetry(like, sphere);
}

nn::Var OffsetMap::Apply(const nn::Var& raw) const {
  if (!raw.valid()) return raw;
  const bool plain = !rules_.symmetric && rules_.smoothing == 0;
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
  return nn::Transpose(nn::Reshape(offsets, {3 * vertices_, batch}));
}

}  // namespace tilegrad::train

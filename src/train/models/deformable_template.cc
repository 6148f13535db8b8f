// SPDX-License-Identifier: Apache-2.0
#include "train/models/deformable_template.h"

#include <vector>

#include "nn/nn.h"
#include "scene/shapes.h"
#include "train/models/sphere_vertices.h"

namespace tilegrad::train {
namespace {

// A quarter of the unit sphere is what N3MR's vertices start from.
constexpr double kN3mrRadius = 0.25;

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
  offsets_ =
      OffsetMap(context, mesh_, {.smoothing = config.smoothing, .symmetric = config.symmetric});
}

nn::Var DeformableTemplate::Movement(const nn::Var& raw) const {
  return config_.n3mr_vertices ? N3mrMovement(raw) : offsets_.Apply(raw);
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

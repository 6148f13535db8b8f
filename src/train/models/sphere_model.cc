// SPDX-License-Identifier: Apache-2.0
#include "train/models/sphere_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "base/error.h"
#include "render/picture/composite.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

// A quarter of the unit sphere is what N3MR's vertices start from.
constexpr double kN3mrRadius = 0.25;

Mesh SphereOf(const SphereConfig& config) {
  const double radius = config.n3mr_vertices ? kN3mrRadius : config.radius;
  return Icosphere(static_cast<int>(config.level), static_cast<float>(radius));
}

// One round of diffusion over a mesh: each vertex goes halfway to the mean of its neighbours.
// Vertex-to-vertex noise decays with the rounds; smooth offsets remain.
nn::AxisMap DiffusionRound(const nn::Var& like, const Topology& topology, std::int64_t vertices) {
  return nn::MakeAxisMap(like, {vertices, vertices}, [&](std::int64_t v, nn::AxisTerms& terms) {
    const auto at = topology.offsets.begin() + v;
    terms.push_back({v, 0.5});
    for (std::int32_t n = at[0]; n < at[1]; ++n)
      terms.push_back({topology.neighbors[static_cast<std::size_t>(n)], 0.5 / (at[1] - at[0])});
  });
}

// The vertex at (-x, y, z) for each vertex of a sphere: mirrored coordinates have equal bits.
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
    const std::int64_t axis = i % 3;
    const std::int64_t other = 3 * mirror[static_cast<std::size_t>(i / 3)] + axis;
    terms.push_back({i, 0.5});
    terms.push_back({other, axis == 0 ? -0.5 : 0.5});
  });
}

void AddTexture(const SphereModel& sphere, const Prediction& prediction, std::size_t i,
                Mesh* mesh) {
  const auto size = static_cast<int>(prediction.textures.shape()[1]);
  ImageU8 image(size, size, 3);
  std::ranges::transform(ItemOf(prediction.textures, i), image.pixels.begin(), ToByte);
  mesh->corner_uvs = sphere.corner_uvs();
  mesh->textures = {{"predicted", std::move(image)}};
  mesh->materials = {{.name = "predicted",
                      .base_color = glm::vec4(1),
                      .base_color_texture = 0,
                      .wrap = {TextureWrap::kRepeat, TextureWrap::kClamp}}};
}

void AddColors(std::span<const float> c, Mesh* mesh) {
  const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  for (std::size_t i = 0; i < c.size(); i += 3)
    mesh->colors.emplace_back(unit(c[i]), unit(c[i + 1]), unit(c[i + 2]), 1.0f);
}

}  // namespace

SphereModel::SphereModel(nn::Context& context, const SphereConfig& config)
    : context_(context),
      config_(config),
      mesh_(SphereOf(config)),
      topology_(BuildTopology(mesh_.faces, mesh_.positions.size())),
      uvs_(SphereUvs(mesh_)) {
  const std::span<const float> flat(&mesh_.positions[0].x, 3 * mesh_.positions.size());
  positions_ = context.From({vertices(), 3}, flat);
  if (config.n3mr_vertices) {
    std::vector<float> unit(flat.begin(), flat.end());
    for (float& x : unit) x /= static_cast<float>(kN3mrRadius);
    unit_sphere_ = context.From({vertices(), 3}, std::span<const float>(unit));
    return;
  }
  const nn::Var like = nn::Constant(context, 0.0);
  diffusion_ = DiffusionRound(like, topology_, vertices());
  if (config.symmetric) symmetry_ = Symmetry(like, mesh_);
}

nn::Var SphereModel::Movement(const nn::Var& raw) const {
  if (!raw.valid()) return raw;
  if (config_.n3mr_vertices) return N3mrMovement(raw);
  const bool plain = !config_.symmetric && config_.smoothing == 0;
  return nn::Reshape(plain ? raw : Mapped(raw), {raw.shape()[0], vertices(), 3});
}

nn::Var SphereModel::Positions() const { return nn::Constant(context_, positions_); }

nn::Var SphereModel::Normalized(const nn::Var& movement) const {
  return NormalizeMeshes(movement + Positions(), config_.half_extent);
}

// With the batch last, so that lanes run over it.
nn::Var SphereModel::Mapped(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0];
  nn::Var offsets = nn::Transpose(raw);
  if (config_.symmetric) offsets = nn::MapAxis(offsets, 0, symmetry_);
  offsets = nn::Reshape(offsets, {vertices(), 3 * batch});
  for (std::int64_t round = 0; round < config_.smoothing; ++round)
    offsets = nn::MapAxis(offsets, 0, diffusion_);
  return nn::Transpose(nn::Reshape(offsets, {3 * vertices(), batch}));
}

// The last three numbers are the centroid. Published, its layer learns at a tenth of the rate.
// Adam's steps do not depend on a factor behind the layer, so a factor of a tenth does the same.
nn::Var SphereModel::N3mrMovement(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0];
  const nn::Var bias = nn::Reshape(nn::Slice(raw, 1, 0, 3 * vertices()), {batch, vertices(), 3});
  const nn::Var centroid =
      nn::Reshape(nn::Slice(raw, 1, 3 * vertices(), 3 * vertices() + 3), {batch, 1, 3});
  return SphereVertices(bias, 0.1 * centroid, unit_sphere_) - Positions();
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

nn::AxisMap MirrorColumns(nn::Context& context, std::int64_t width) {
  return nn::MakeAxisMap(nn::Constant(context, 0.0), {width, width},
                         [&](std::int64_t i, nn::AxisTerms& terms) {
                           terms.push_back({i, 0.5});
                           terms.push_back({(width / 2 - 1 - i + width) % width, 0.5});
                         });
}

nn::Var SphereVertices(const nn::Var& bias, const nn::Var& centroid, const nn::Tensor& sphere) {
  nn::Context& context = bias.context();
  nn::Tensor given = sphere;
  std::vector<double> sign, logit;
  nn::WithFloatType(sphere.dtype(), [&]<class T>(T) {
    for (const T value : given.span<T>()) {
      const double half = std::abs(static_cast<double>(value)) / 2;
      sign.push_back(half > 0 ? std::copysign(1.0, static_cast<double>(value)) : 0.0);
      logit.push_back(half > 0 ? std::log(half / (1 - half)) : 0.0);  // of no effect at 0
    }
  });
  const auto constant = [&](const std::vector<double>& values) {
    return nn::Constant(context, context.From(sphere.shape(), std::span<const double>(values)));
  };
  const nn::Var u = constant(sign) * nn::Sigmoid(bias + constant(logit));
  const nn::Var c = nn::Tanh(0.1 * centroid);
  return 0.5 * (nn::Relu(u) * (1.0 - c) - nn::Relu(-u) * (1.0 + c) + c);
}

Result<Mesh> MeshOf(const SphereModel& sphere, const Prediction& prediction, std::size_t i) {
  Mesh mesh;
  mesh.faces = sphere.mesh().faces;
  const std::span<const float> p = ItemOf(prediction.positions, i);
  for (std::size_t v = 0; v < p.size(); v += 3)
    mesh.positions.emplace_back(p[v], p[v + 1], p[v + 2]);
  if (prediction.textures.valid()) AddTexture(sphere, prediction, i, &mesh);
  if (prediction.colors.valid()) AddColors(ItemOf(prediction.colors, i), &mesh);
  if (const Status valid = Validate(mesh); !valid.ok())
    return InternalError("the prediction is invalid: {}", valid.message());
  return mesh;
}

nn::Tensor InputOf(nn::Context& context, std::span<const std::uint8_t> images, int size) {
  const auto count = static_cast<std::int64_t>(images.size()) / (4 * size * size);
  nn::Tensor input = context.Empty({count, 4, size, size});
  std::ranges::transform(images, input.data<float>(),
                         [](std::uint8_t b) { return static_cast<float>(b) / 255; });
  return input;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/models/mesh_network.h"

#include <map>
#include <tuple>

#include "base/error.h"
#include "nn/networks/blocks.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "scene/topology.h"
#include "train/models/sphere_vertices.h"
#include "train/ops/sample_colors.h"

namespace tilegrad::train {
namespace {

constexpr int kKernel = 5;
constexpr double kWideStart = 1.4;  // narrowness of SampleColors: a deviation of half a picture's half
constexpr nn::ConvOptions kHalve = {.stride = 2, .padding = 2};
const nn::BatchNormOptions kRelu = {.relu = true};

struct Builder {
  nn::Context& context;
  const NetworkConfig& config;
  Rng& rng;

  void Conv(nn::Sequential& net, const std::string& name, std::int64_t in, std::int64_t out) {
    net.Add<nn::Conv2dLayer>(
        "conv" + name, context,
        nn::ConvShape{.in = in, .out = out, .kernel = kKernel, .options = kHalve}, rng);
    net.Add<nn::BatchNorm>("conv_norm" + name, context, out, kRelu);
  }
  void Blocks(nn::Sequential& net, const std::string& name, std::int64_t channels) {
    for (std::int64_t i = 0; i < config.blocks; ++i) {
      const std::string block = fmt::format("block{}_{}", name, i + 1);
      nn::AddResidualBlock(net, block, context,
                           {.in = channels, .out = channels, .norm = nn::Norm::kBatch}, rng);
      net.Add<nn::Activation>(block + "_relu", &nn::Relu);
    }
  }
  nn::LinearLayer& Fc(nn::Sequential& net, const std::string& name, std::int64_t in,
                      std::int64_t out) {
    auto& layer =
        net.Add<nn::LinearLayer>("fc" + name, context, nn::LinearShape{.in = in, .out = out}, rng);
    if (config.fc_deviation > 0) nn::FillNormal(layer.weight.value(), rng, config.fc_deviation);
    return layer;
  }
  void FcRelu(nn::Sequential& net, const std::string& name, std::int64_t in, std::int64_t out) {
    Fc(net, name, in, out);
    if (config.fc_norm) {
      net.Add<nn::BatchNorm>("fc_norm" + name, context, out, kRelu);
    } else {
      net.Add<nn::Activation>("fc_relu" + name, &nn::Relu);
    }
  }
};

void BuildEncoder(Builder& b, nn::Sequential& net, int image_size) {
  const std::int64_t c = b.config.channels, code = b.config.code, side = image_size / 8;
  b.Conv(net, "1", 4, c);
  b.Conv(net, "2", c, 2 * c);
  b.Blocks(net, "2", 2 * c);
  b.Conv(net, "3", 2 * c, 4 * c);
  b.Blocks(net, "3", 4 * c);
  net.Add<nn::Flatten>("flatten");
  b.FcRelu(net, "1", 4 * c * side * side, code);
  b.FcRelu(net, "2", code, code);
  b.Fc(net, "3", code, code);
}

nn::LinearLayer& BuildDecoder(Builder& b, nn::Sequential& net, std::int64_t numbers) {
  b.FcRelu(net, "1", b.config.code, b.config.hidden1);
  b.FcRelu(net, "2", b.config.hidden1, b.config.hidden2);
  auto& output = b.Fc(net, "3", b.config.hidden2, numbers);
  nn::FillNormal(output.weight.value(), b.rng, b.config.output_deviation);
  return output;
}

// Colours that are read from the picture start as the mean of nearly all of it, all alike.
void BuildColors(Builder& b, nn::Sequential& net, std::int64_t vertices) {
  if (!b.config.picture_colors) {
    nn::FillConstant(BuildDecoder(b, net, 3 * vertices).bias.value(), b.config.color_bias);
    return;
  }
  nn::Tensor bias = BuildDecoder(b, net, 4 * vertices).bias.value();
  nn::WithFloatType(bias.dtype(), [&]<class T>(T) {
    const std::span<T> values = bias.span<T>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = i % 4 == 2 ? T(kWideStart) : T(0);
  });
}

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

void MeshNetwork::Parts::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  encoder.Visit(prefix + "encoder.", visitor);
  shape.Visit(prefix + "shape.", visitor);
  color.Visit(prefix + "color.", visitor);
}

MeshNetwork::MeshNetwork(nn::Context& context, const NetworkConfig& config, int image_size,
                         std::uint64_t seed)
    : context_(context),
      template_(Icosphere(
          static_cast<int>(config.template_level),
          static_cast<float>(config.n3mr_vertices ? kN3mrRadius : config.template_radius))),
      config_(config) {
  Rng rng(seed, /*stream=*/0x6e6574);
  Builder builder{context, config, rng};
  const auto vertices = static_cast<std::int64_t>(template_.positions.size());
  BuildEncoder(builder, all_.encoder, image_size);
  BuildDecoder(builder, all_.shape, 3 * vertices + (config.n3mr_vertices ? 3 : 0));
  BuildColors(builder, all_.color, vertices);
  const std::span<const float> flat(&template_.positions[0].x, 3 * template_.positions.size());
  template_positions_ = context.From({vertices, 3}, flat);
  std::vector<float> unit(flat.begin(), flat.end());
  for (float& x : unit) x /= static_cast<float>(kN3mrRadius);
  if (config.n3mr_vertices)
    unit_sphere_ = context.From({vertices, 3}, std::span<const float>(unit));
  const nn::Var like = nn::Constant(context, template_positions_);
  diffusion_ = DiffusionRound(like, template_);
  if (config.symmetric) symmetry_ = Symmetry(like, template_);
}

nn::Var MeshNetwork::Movement(const nn::Var& code, nn::Mode mode) {
  const std::int64_t batch = code.shape()[0], vertices = template_positions_.shape()[0];
  const nn::Var raw = all_.shape.Forward(code, mode);
  if (config_.n3mr_vertices) return N3mrMovement(raw);
  nn::Var movement = raw;
  if (config_.symmetric || config_.smoothing > 0) movement = nn::Transpose(Smoothed(raw));
  return nn::Reshape(movement, {batch, vertices, 3});
}

// [3 V, B] of [B, 3 V]: with the batch last, lanes run over it.
nn::Var MeshNetwork::Smoothed(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0], vertices = template_positions_.shape()[0];
  nn::Var movement = nn::Transpose(raw);
  if (config_.symmetric) movement = nn::MapAxis(movement, 0, symmetry_);
  movement = nn::Reshape(movement, {vertices, 3 * batch});
  for (std::int64_t round = 0; round < config_.smoothing; ++round)
    movement = nn::MapAxis(movement, 0, diffusion_);
  return nn::Reshape(movement, {3 * vertices, batch});
}

// The last three outputs are the centroid. Published, its layer learns at a tenth of the rate.
// Adam's steps do not depend on a factor behind the layer, so a factor of a tenth does the same.
nn::Var MeshNetwork::N3mrMovement(const nn::Var& raw) const {
  const std::int64_t batch = raw.shape()[0], vertices = template_positions_.shape()[0];
  const nn::Var bias = nn::Reshape(nn::Slice(raw, 1, 0, 3 * vertices), {batch, vertices, 3});
  const nn::Var centroid =
      nn::Reshape(nn::Slice(raw, 1, 3 * vertices, 3 * vertices + 3), {batch, 1, 3});
  const nn::Var start = nn::Constant(context_, template_positions_);
  return SphereVertices(bias, 0.1 * centroid, unit_sphere_) - start;
}

nn::Var MeshNetwork::Colors(const nn::Var& code, const nn::Var& images, nn::Mode mode) {
  const std::int64_t batch = code.shape()[0], vertices = template_positions_.shape()[0];
  const nn::Var raw = all_.color.Forward(code, mode);
  if (!config_.picture_colors) return nn::Reshape(raw, {batch, vertices, 3});
  return SampleColors(images.value(), nn::Reshape(raw, {batch, vertices, 4}));
}

PredictedMeshes MeshNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  const nn::Var code = all_.encoder.Forward(images, mode);
  PredictedMeshes out;
  out.movement = Movement(code, mode);
  out.colors = Colors(code, images, mode);
  out.positions = NormalizeMeshes(out.movement + nn::Constant(context_, template_positions_),
                                  kPredictionHalfExtent);
  return out;
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

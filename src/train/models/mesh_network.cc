// SPDX-License-Identifier: Apache-2.0
#include "train/models/mesh_network.h"

#include "nn/nn.h"
#include "scene/shapes.h"
#include "scene/topology.h"

namespace tilegrad::train {
namespace {

constexpr int kKernel = 5;
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
  nn::LinearLayer& Fc(nn::Sequential& net, const std::string& name, std::int64_t in,
                      std::int64_t out) {
    auto& layer =
        net.Add<nn::LinearLayer>("fc" + name, context, nn::LinearShape{.in = in, .out = out}, rng);
    if (config.fc_deviation > 0) nn::FillNormal(layer.weight.value(), rng, config.fc_deviation);
    return layer;
  }
  void FcRelu(nn::Sequential& net, const std::string& name, std::int64_t in, std::int64_t out) {
    Fc(net, name, in, out);
    net.Add<nn::BatchNorm>("fc_norm" + name, context, out, kRelu);
  }
};

void BuildEncoder(Builder& b, nn::Sequential& net, int image_size) {
  const std::int64_t c = b.config.channels, code = b.config.code, side = image_size / 8;
  b.Conv(net, "1", 4, c);
  b.Conv(net, "2", c, 2 * c);
  b.Conv(net, "3", 2 * c, 4 * c);
  net.Add<nn::Flatten>("flatten");
  b.FcRelu(net, "1", 4 * c * side * side, code);
  b.FcRelu(net, "2", code, code);
  b.Fc(net, "3", code, code);
}

nn::LinearLayer& BuildDecoder(Builder& b, nn::Sequential& net, std::int64_t vertices) {
  b.FcRelu(net, "1", b.config.code, b.config.hidden1);
  b.FcRelu(net, "2", b.config.hidden1, b.config.hidden2);
  auto& output = b.Fc(net, "3", b.config.hidden2, 3 * vertices);
  nn::FillNormal(output.weight.value(), b.rng, b.config.output_deviation);
  return output;
}

// Rows of D = ((I + A) / 2)^rounds, where A takes the mean over a vertex's neighbours: what
// diffusion makes of an impulse. Noise from vertex to vertex dies out, and what is smooth stays.
std::vector<float> DiffusionMatrix(const Topology& topology, std::int64_t rounds) {
  const std::size_t n = topology.offsets.size() - 1;
  std::vector<float> rows(n * n, 0.0f), next(n * n);
  for (std::size_t v = 0; v < n; ++v) rows[v * n + v] = 1;
  for (std::int64_t round = 0; round < rounds; ++round) {
    for (std::size_t v = 0; v < n; ++v) {
      const auto begin = static_cast<std::size_t>(topology.offsets[v]);
      const auto end = static_cast<std::size_t>(topology.offsets[v + 1]);
      const float share = 0.5f / static_cast<float>(end - begin);
      for (std::size_t u = 0; u < n; ++u) {
        float sum = 0;
        for (std::size_t k = begin; k < end; ++k)
          sum += rows[static_cast<std::size_t>(topology.neighbors[k]) * n + u];
        next[v * n + u] = 0.5f * rows[v * n + u] + share * sum;
      }
    }
    rows.swap(next);
  }
  return rows;
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
      template_(Icosphere(static_cast<int>(config.template_level),
                          static_cast<float>(config.template_radius))) {
  Rng rng(seed, /*stream=*/0x6e6574);
  Builder builder{context, config, rng};
  const auto vertices = static_cast<std::int64_t>(template_.positions.size());
  BuildEncoder(builder, all_.encoder, image_size);
  BuildDecoder(builder, all_.shape, vertices);
  nn::FillConstant(BuildDecoder(builder, all_.color, vertices).bias.value(), config.color_bias);
  const std::span<const float> flat(&template_.positions[0].x, 3 * template_.positions.size());
  template_positions_ = context.From({vertices, 3}, flat);
  if (config.smoothing > 0) {
    const Topology topology = BuildTopology(template_.faces, template_.positions.size());
    diffusion_ = context.From({vertices, vertices}, DiffusionMatrix(topology, config.smoothing));
  }
}

nn::Var MeshNetwork::Movement(const nn::Var& code, nn::Mode mode) {
  const std::int64_t batch = code.shape()[0], vertices = template_positions_.shape()[0];
  const nn::Var offsets = all_.shape.Forward(code, mode);
  if (diffusion_.empty()) return nn::Reshape(offsets, {batch, vertices, 3});
  const nn::Var smooth = nn::Matmul(nn::Reshape(offsets, {batch * 3, vertices}),
                                    nn::Constant(context_, diffusion_), {.transpose_b = true});
  return nn::Permute(nn::Reshape(smooth, {batch, 3, vertices}), {0, 2, 1});
}

PredictedMeshes MeshNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  const std::int64_t batch = images.shape()[0], vertices = template_positions_.shape()[0];
  const nn::Var code = all_.encoder.Forward(images, mode);
  PredictedMeshes out;
  out.movement = Movement(code, mode);
  out.colors = nn::Reshape(all_.color.Forward(code, mode), {batch, vertices, 3});
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

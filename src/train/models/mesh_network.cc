// SPDX-License-Identifier: Apache-2.0
#include "train/models/mesh_network.h"

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

constexpr int kKernel = 5;
constexpr double kWideStart =
    1.4;  // narrowness of SampleColors: a deviation of half a picture's half
constexpr nn::ConvOptions kHalve = {.stride = 2, .padding = 2};
const nn::BatchNormOptions kRelu = {.relu = true};

struct NetworkBuilder {
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
    if (config.fc_norm) {
      net.Add<nn::BatchNorm>("fc_norm" + name, context, out, kRelu);
    } else {
      net.Add<nn::Activation>("fc_relu" + name, &nn::Relu);
    }
  }
};

void BuildEncoder(NetworkBuilder& b, nn::Sequential& net, int image_size) {
  const std::int64_t c = b.config.channels, code = b.config.code, side = image_size / 8;
  b.Conv(net, "1", 4, c);
  b.Conv(net, "2", c, 2 * c);
  b.Conv(net, "3", 2 * c, 4 * c);
  net.Add<nn::Flatten>("flatten");
  b.FcRelu(net, "1", 4 * c * side * side, code);
  b.FcRelu(net, "2", code, code);
  b.Fc(net, "3", code, code);
}

nn::LinearLayer& BuildDecoder(NetworkBuilder& b, nn::Sequential& net, std::int64_t numbers) {
  b.FcRelu(net, "1", b.config.code, b.config.hidden1);
  b.FcRelu(net, "2", b.config.hidden1, b.config.hidden2);
  auto& output = b.Fc(net, "3", b.config.hidden2, numbers);
  nn::FillNormal(output.weight.value(), b.rng, b.config.output_deviation);
  return output;
}

// Colours that are read from the picture start as the mean of nearly all of it, all alike.
void BuildColors(NetworkBuilder& b, nn::Sequential& net, std::int64_t vertices) {
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

}  // namespace

void MeshNetwork::Parts::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  encoder.Visit(prefix + "encoder.", visitor);
  shape.Visit(prefix + "shape.", visitor);
  color.Visit(prefix + "color.", visitor);
}

MeshNetwork::MeshNetwork(nn::Context& context, const NetworkConfig& config, int image_size,
                         std::uint64_t seed)
    : config_(config), sphere_(context, config.sphere) {
  Rng rng(seed, /*stream=*/0x6e6574);
  NetworkBuilder builder{context, config, rng};
  BuildEncoder(builder, all_.encoder, image_size);
  BuildDecoder(builder, all_.shape, sphere_.numbers());
  BuildColors(builder, all_.color, sphere_.vertices());
}

nn::Var MeshNetwork::Colors(const nn::Var& code, const nn::Var& images, nn::Mode mode) {
  const std::int64_t batch = code.shape()[0], vertices = sphere_.vertices();
  const nn::Var raw = all_.color.Forward(code, mode);
  if (!config_.picture_colors) return nn::Reshape(raw, {batch, vertices, 3});
  return nn::SampleColors(images.value(), nn::Reshape(raw, {batch, vertices, 4}));
}

Prediction MeshNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  const nn::Var code = all_.encoder.Forward(images, mode);
  Prediction out;
  out.movement = sphere_.Movement(all_.shape.Forward(code, mode));
  out.positions = sphere_.Normalized(out.movement);
  out.colors = Colors(code, images, mode);
  return out;
}

}  // namespace tilegrad::train

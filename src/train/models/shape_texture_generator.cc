// SPDX-License-Identifier: Apache-2.0
#include "train/models/shape_texture_generator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

constexpr std::int64_t kRootRows = 8;  // of the smallest map
constexpr double kLeastShare = 0.02;   // of a channel of the mean map: logits stay finite

nn::Var Twice(const nn::Var& x) {
  if (!x.valid()) return x;
  return nn::Resize(x, {2 * x.shape()[2], 2 * x.shape()[3]}, nn::ResizeMode::kNearest);
}

// A frame of one pixel. Left and right of half a map is its mirror image, whose next column has the
// colours of the edge; above and below the poles, what lies at them.
nn::Var FrameOfHalf(const nn::Var& map) {
  return nn::PadImage(map, nn::Padding::All(1), nn::PadMode::kReplicate);
}

// Left and right edge of a whole map are neighbours.
nn::Var FrameOfWhole(const nn::Var& map) {
  return nn::PadImage(map, nn::Padding::All(1), {nn::PadMode::kReplicate, nn::PadMode::kCircular});
}

// Which column of a map each column of a texture shows. The mirror image at x = 0 of column i is
// W/2 - 1 - i (scene/shapes.h).
nn::Tensor MapColumns(nn::Context& context, const GeneratorConfig& config) {
  const std::int64_t width = config.texture_size, half = width / 2;
  const std::int64_t first = ShapeTextureGenerator::FirstColumn(config);
  std::vector<std::int32_t> columns;
  for (std::int64_t i = 0; i < width; ++i) {
    const bool inside = i >= first && i < first + ShapeTextureGenerator::MapWidth(config);
    const std::int64_t shown = inside ? i : (half - 1 - i + width) % width;
    columns.push_back(static_cast<std::int32_t>(shown - first));
  }
  return context.Indices(columns);
}

}  // namespace

Status CheckGenerator(const GeneratorConfig& config) {
  if (config.shape_noise > config.noise)
    return InvalidArgument("network.shape_noise is {}, but must be at most network.noise, {}",
                           config.shape_noise, config.noise);
  const auto size = static_cast<std::uint64_t>(config.texture_size);
  if (size >= 2 * kRootRows && std::has_single_bit(size)) return {};
  return InvalidArgument("network.texture_size is {}, but must be a power of two from {}",
                         config.texture_size, 2 * kRootRows);
}

void ShapeTextureGenerator::ShapeNet::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  net.Visit(prefix, visitor);
  visitor.Buffer(prefix + "scale", scale);
}

nn::Var ShapeTextureGenerator::TextureNet::Forward(const nn::Var& noise, nn::Mode mode) {
  nn::Var flat = first.Forward(noise, mode);
  if (!flat.valid()) return flat;
  const nn::Var map =
      net.Forward(nn::Reshape(flat, {flat.shape()[0], root[0], root[1], root[2]}), mode);
  return nn::Sigmoid(map + nn::Constant(noise.context(), mean));
}

void ShapeTextureGenerator::TextureNet::Visit(const std::string& prefix,
                                              nn::ModuleVisitor& visitor) {
  first.Visit(prefix, visitor);
  net.Visit(prefix, visitor);
  visitor.Buffer(prefix + "mean", mean);
}

ShapeTextureGenerator::ShapeTextureGenerator(nn::Context& context, const GeneratorConfig& config,
                                             std::uint64_t seed)
    : context_(context),
      config_(config),
      sphere_(context, config.sphere),
      columns_(MapColumns(context, config)) {
  Rng rng(seed, /*stream=*/0x67656e);
  BuildShape(rng);
  BuildTexture(rng);
}

void ShapeTextureGenerator::BuildShape(Rng& rng) {
  nn::Sequential& net = shape_.net;
  nn::AddLinear(net, "fc1", context_, config_.shape_noise, config_.hidden, rng);
  net.Add<nn::Activation>("act1", &nn::LeakyRelu02);
  nn::AddLinear(net, "fc2", context_, config_.hidden, config_.hidden, rng);
  net.Add<nn::Activation>("act2", &nn::LeakyRelu02);
  auto& offsets = nn::AddLinear(net, "fc3", context_, config_.hidden, sphere_.numbers(), rng);
  nn::FillNormal(offsets.weight.value(), rng, config_.output_deviation);
  nn::FillConstant(offsets.bias.value(), 0);
  shape_.scale = context_.Full({3}, 1);
}

void ShapeTextureGenerator::BuildTexture(Rng& rng) {
  const std::int64_t rows = config_.texture_size;
  const int doublings = std::countr_zero(static_cast<std::uint64_t>(rows / kRootRows));
  const auto channels = [&](int halvings) {  // below full size
    return std::min(config_.texture_most, config_.texture_base << std::min(halvings, 30));
  };
  texture_.root = {channels(doublings), kRootRows, map_width() >> doublings};
  nn::AddLinear(texture_.first, "fc", context_, config_.noise, texture_.root.elements(), rng);
  const auto frame = config_.symmetric_texture ? &FrameOfHalf : &FrameOfWhole;
  nn::Sequential& net = texture_.net;
  net.Add<nn::BatchNorm>("norm", context_, channels(doublings));
  net.Add<nn::Activation>("act", &nn::LeakyRelu02);
  for (int level = doublings; level > 0; --level) {
    const std::string name = "up" + std::to_string(doublings - level + 1);
    net.Add<nn::Activation>(name + ".resize", &Twice);
    net.Add<nn::Activation>(name + ".frame", frame);
    const bool last = level == 1;
    nn::AddConvBlock(
        net, name, context_,
        {.conv = {.in = channels(level), .out = last ? 3 : channels(level - 1), .options = {}},
         .norm = !last,
         .activation = last ? nullptr : &nn::LeakyRelu02},
        rng);
  }
  texture_.mean = context_.Zeros({1, 3, rows, map_width()});
}

Prediction ShapeTextureGenerator::MakeShapes(const nn::Var& noise, nn::Mode mode) {
  const nn::Var own = nn::Slice(noise, 1, 0, config_.shape_noise);
  const nn::Var movement = sphere_.Movement(shape_.Forward(own, mode));
  const nn::Var start = nn::Constant(context_, shape_.scale) * sphere_.Positions();
  return {.movement = movement, .positions = movement + start};
}

nn::Var ShapeTextureGenerator::MakeMaps(const nn::Var& noise, nn::Mode mode) {
  return texture_.Forward(noise, mode);
}

nn::Var ShapeTextureGenerator::MeanMaps(std::int64_t count) const {
  const nn::Shape& one = texture_.mean.shape();
  return nn::BroadcastTo(nn::Sigmoid(nn::Constant(context_, texture_.mean)),
                         {count, one[1], one[2], one[3]});
}

nn::Var ShapeTextureGenerator::Textures(const nn::Var& maps) const {
  return nn::Permute(nn::Gather(maps, 3, columns_), {0, 2, 3, 1});
}

void ShapeTextureGenerator::SetEllipsoid(const std::array<double, 3>& half_axes) {
  nn::WithFloatType(shape_.scale.dtype(), [&]<class T>(T) {
    std::ranges::transform(half_axes, shape_.scale.span<T>().begin(), [&](double half) {
      return static_cast<T>(half / config_.sphere.radius);
    });
  });
}

void ShapeTextureGenerator::SetMeanMap(std::span<const float> map) {
  nn::WithFloatType(texture_.mean.dtype(), [&]<class T>(T) {
    std::ranges::transform(map, texture_.mean.span<T>().begin(), [](float share) {
      const double p = std::clamp<double>(share, kLeastShare, 1 - kLeastShare);
      return static_cast<T>(std::log(p / (1 - p)));
    });
  });
}

}  // namespace tilegrad::train

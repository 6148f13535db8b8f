// SPDX-License-Identifier: Apache-2.0
#include "train/models/texture_network.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"
#include "scene/harmonics.h"
#include "scene/shapes.h"
#include "scene/sphere_uv.h"
#include "train/models/mesh_network.h"
#include "train/models/mirror_columns.h"
#include "train/models/palette.h"

namespace tilegrad::train {
namespace {

constexpr int kResidualPairs = 3;          // of two layers: the six of section 5.2
constexpr std::int64_t kPaintNumbers = 8;  // of a texel: three shares, two gains, a colour
// Of what is above 1 this share is taken off; the rest leaves a gradient that leads back.
constexpr double kTooBright = 0.9;
constexpr double kStartLight = 0.7;  // of harmonics, from everywhere

std::int64_t LightNumbers(Lighting lighting) {
  switch (lighting) {
    case Lighting::kLambert:
      return 3;
    case Lighting::kPhong:
      return 4;
    case Lighting::kSphericalHarmonics:
      return 9;
    default:
      return 0;
  }
}

// What the head says of an image that it knows nothing about: light from the camera, or from
// everywhere.
void SetStartLight(Lighting lighting, nn::Tensor& bias) {
  nn::WithFloatType(bias.dtype(), [&]<class T>(T) {
    const std::span<T> b = bias.span<T>();
    std::fill(b.begin(), b.end(), T(0));
    if (lighting == Lighting::kSphericalHarmonics) {
      b[0] = static_cast<T>(kStartLight / kHarmonic0);
    } else {
      b[2] = T(1);
    }
  });
}

nn::Var Unit(const nn::Var& v) {
  return v / nn::Sqrt(nn::Sum(nn::Square(v), {1}, nn::Keep::kYes) + 1e-8);
}

// A frame of one pixel around a map of the sphere: left and right edges are neighbours.
nn::Var WrapAround(const nn::Var& map) {
  return nn::Pad(nn::Pad(map, 3, 1, 1, nn::PadMode::kCircular), 2, 1, 1, nn::PadMode::kReplicate);
}

// The third number to above 0, smoothly; 1 stays about where it is.
nn::Var Facing(const nn::Var& raw) {
  return nn::Concat({nn::Slice(raw, 1, 0, 2), nn::Softplus(nn::Slice(raw, 1, 2, 3))}, 1);
}

}  // namespace

Status CheckImageSize(const TextureNetworkConfig& config, int image_size) {
  if (nn::CanHalve(image_size, config.levels)) return {};
  return InvalidArgument(
      "images of {} pixels a side cannot be halved {} times to at least two pixels: choose a "
      "smaller "
      "network.levels",
      image_size, config.levels);
}

void TextureNetwork::Parts::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  unet->Visit(prefix + "unet.", visitor);
  latent.Visit(prefix + "latent.", visitor);
  map.Visit(prefix + "map.", visitor);
  shape.Visit(prefix + "shape.", visitor);
  light.Visit(prefix + "light.", visitor);
  pose.Visit(prefix + "pose.", visitor);
  paint.Visit(prefix + "paint.", visitor);
}

TextureNetwork::TextureNetwork(nn::Context& context, const TextureNetworkConfig& config,
                               const LightHeadShape& light, int image_size, std::uint64_t seed)
    : context_(context),
      config_(config),
      light_(light),
      texture_size_(image_size << config.enlarge),
      template_(Icosphere(static_cast<int>(config.template_level),
                          static_cast<float>(config.template_radius))),
      uvs_(SphereUvs(template_)) {
  Rng rng(seed, /*stream=*/0x74657874);
  const nn::UNetShape unet{.in = 4,
                           .out = config.lookup ? config.lookup_width : 3,
                           .base = config.base,
                           .most = config.most,
                           .levels = static_cast<int>(config.levels),
                           .norm = nn::Norm::kBatch,
                           .resize = true,
                           .skips = config.skips,
                           .enlarge = config.lookup ? 0 : static_cast<int>(config.enlarge),
                           .wrap = config.wrap,
                           .output = config.lookup ? &nn::LeakyRelu02 : &nn::Sigmoid};
  all_.unet = std::make_unique<nn::UNet>(context, unet, rng);
  const std::int64_t side = image_size >> config.levels;
  const std::int64_t channels = std::min(config.most, config.base << (config.levels - 1));
  code_shape_ = {channels, side, side};
  BuildHeads(rng);
  const std::span<const float> flat(&template_.positions[0].x, 3 * template_.positions.size());
  template_positions_ =
      context.From({static_cast<std::int64_t>(template_.positions.size()), 3}, flat);
  offsets_ =
      OffsetMap(context, template_, {.smoothing = config.smoothing, .symmetric = config.symmetric});
  if (config.lookup) BuildLookup(image_size, rng);
  if (config.cubes) cubes_ = FaceCubes(context, template_, texture_size_);
  if (config.symmetric_texture) mirror_ = MirrorColumns(context, texture_size_);
}

void TextureNetwork::BuildHeads(Rng& rng) {
  const std::int64_t code = code_shape_.elements(), latent = config_.latent;
  all_.latent.Add<nn::Flatten>("flatten");
  all_.latent.Add<nn::Activation>("act1", &nn::LeakyRelu02);
  nn::AddLinear(all_.latent, "fc", context_, code, latent, rng);
  all_.latent.Add<nn::Activation>("act2", &nn::LeakyRelu02);
  nn::AddLinear(all_.map, "fc", context_, latent, code, rng);
  nn::AddLinear(all_.shape, "fc1", context_, latent, config_.hidden, rng);
  all_.shape.Add<nn::Activation>("act", &nn::Relu);
  const auto numbers = static_cast<std::int64_t>(3 * template_.positions.size());
  auto& offsets = nn::AddLinear(all_.shape, "fc2", context_, config_.hidden, numbers, rng);
  nn::FillNormal(offsets.weight.value(), rng, config_.output_deviation);
  nn::FillConstant(offsets.bias.value(), 0);
  const std::int64_t light = LightNumbers(light_.lighting), width = config_.light_width;
  if (light == 0) return;
  nn::AddLinear(all_.light, "in", context_, latent + (config_.lookup ? PictureLookup::kCues : 0),
                width, rng);
  for (int i = 1; i <= kResidualPairs; ++i) {
    auto& block = all_.light.Add<nn::Residual>("block" + std::to_string(i));
    block.body.Add<nn::Activation>("act1", &nn::Relu);
    nn::AddLinear(block.body, "fc1", context_, width, width, rng);
    block.body.Add<nn::Activation>("act2", &nn::Relu);
    nn::AddLinear(block.body, "fc2", context_, width, width, rng);
  }
  all_.light.Add<nn::Activation>("act", &nn::Relu);
  SetStartLight(light_.lighting,
                nn::AddLinear(all_.light, "out", context_, width, light, rng).bias.value());
}

void TextureNetwork::BuildLookup(int image_size, Rng& rng) {
  coarse_.emplace(template_, image_size);
  fine_.emplace(template_, texture_size_);
  nn::AddLinear(all_.pose, "fc1", context_, config_.latent, config_.light_width, rng);
  all_.pose.Add<nn::Activation>("act", &nn::Relu);
  nn::AddLinear(all_.pose, "fc2", context_, config_.light_width, kPoseNumbers, rng);
  const std::int64_t width = config_.lookup_width;
  const auto add = [&](const std::string& name, std::int64_t in, std::int64_t out) {
    all_.paint.Add<nn::Activation>("wrap" + name, &WrapAround);
    all_.paint.Add<nn::Conv2dLayer>("conv" + name, context_, nn::ConvShape{.in = in, .out = out},
                                    rng);
  };
  add("1", width + 2 * PictureLookup::kChannels, width);
  all_.paint.Add<nn::Activation>("act1", &nn::LeakyRelu02);
  add("2", width, width);
  all_.paint.Add<nn::Activation>("act2", &nn::LeakyRelu02);
  add("3", width, kPaintNumbers + (config_.palette > 0 ? 1 + config_.palette : 0));
}

// A mixture of colours: what the picture shows at the texel and at its mirror image, without
// the predicted light and then brighter or darker, what the network makes up, and that
// of the texel's paint (palette.h). Were the light
// left in it, textures would explain their own pictures best under no light at all.
nn::Var TextureNetwork::Painted(const nn::Var& map, const nn::Tensor& images,
                                const PredictedObjects& objects, nn::Mode mode) {
  const nn::Tensor light = objects.directions.valid() ? objects.directions.value() : nn::Tensor();
  const PictureLookup::Job job{images, objects.positions.value(), objects.pose.value(), light};
  const nn::Var seen = nn::Constant(context_, coarse_->Look(context_, job));
  const nn::Var raw = all_.paint.Forward(nn::Concat({map, seen}, 1), mode);
  const std::int64_t paints = config_.palette;
  const nn::Var shares =
      nn::Softmax(paints == 0 ? nn::Slice(raw, 1, 0, 3)
                              : nn::Concat({nn::Slice(raw, 1, 0, 3), nn::Slice(raw, 1, 8, 9)}, 1),
                  1);
  const nn::Var unlit =
      nn::Concat({nn::Slice(seen, 1, 5, 6), nn::Slice(seen, 1, 11, 12)}, 1);  // ln 1 / light
  const nn::Var looked = nn::Slice(shares, 1, 0, 2) * nn::Exp(nn::Slice(raw, 1, 3, 5) + unlit);
  const nn::Var guess = nn::Sigmoid(nn::Slice(raw, 1, 5, 8));
  nn::Var made = nn::Slice(shares, 1, 2, 3) * guess;
  if (paints > 0) {
    const nn::Var kinds = nn::Softmax(nn::Slice(raw, 1, 9, 9 + paints), 1);
    made = made + nn::Slice(shares, 1, 3, 4) * PaletteColors(kinds, seen.value(), guess);
  }
  const nn::Var all = nn::Resize(nn::Concat({looked, made}, 1), {texture_size_, texture_size_},
                                 nn::ResizeMode::kBilinear);
  const nn::Var colors = nn::Constant(context_, fine_->Colors(context_, job));
  const nn::Var sum = nn::Slice(all, 1, 0, 1) * nn::Slice(colors, 1, 0, 3) +
                      nn::Slice(all, 1, 1, 2) * nn::Slice(colors, 1, 3, 6) +
                      nn::Slice(all, 1, 2, 5);
  return sum - kTooBright * nn::Relu(sum - 1.0);
}

nn::Var TextureNetwork::Texture(const nn::Var& latent, const nn::StepVector<nn::Var>& levels,
                                const PredictedObjects& objects, nn::Mode mode) {
  const nn::Var code =
      nn::Reshape(all_.map.Forward(latent, mode),
                  {latent.shape()[0], code_shape_[0], code_shape_[1], code_shape_[2]});
  nn::Var image = all_.unet->Decode(code, levels, mode);
  if (config_.lookup) image = Painted(image, levels.front().value(), objects, mode);
  if (config_.symmetric_texture) image = nn::MapAxis(image, 3, mirror_);
  return nn::Permute(image, {0, 2, 3, 1});
}

void TextureNetwork::Light(const nn::Var& latent, const nn::Tensor& images, nn::Mode mode,
                           PredictedObjects* out) {
  if (light_.lighting == Lighting::kNone) return;
  nn::Var from = latent;
  if (config_.lookup) {
    const nn::Tensor cues =
        coarse_->Cues(context_, {images, out->positions.value(), out->pose.value()});
    from = nn::Concat({from, nn::Constant(context_, cues)}, 1);
  }
  nn::Var raw = all_.light.Forward(from, mode);
  if (light_.lighting == Lighting::kSphericalHarmonics) {
    out->sh = raw;
    return;
  }
  if (config_.lookup) {
    const std::int64_t cues = from.shape()[1];
    raw = raw + nn::Pad(nn::Slice(from, 1, cues - 3, cues), 1, 0, raw.shape()[1] - 3);
  }
  out->directions = Unit(light_.facing ? Facing(raw) : nn::Slice(raw, 1, 0, 3));
  if (light_.lighting != Lighting::kPhong) return;
  const double low = std::log(light_.shininess_low), high = std::log(light_.shininess_high);
  const nn::Var share = nn::Sigmoid(nn::Reshape(nn::Slice(raw, 1, 3, 4), {raw.shape()[0]}));
  out->shininess = nn::Exp((high - low) * share + low);
}

PredictedObjects TextureNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  PredictedObjects out;
  const nn::StepVector<nn::Var> levels = all_.unet->Encode(images, mode);
  const nn::Var latent = all_.latent.Forward(levels.back(), mode);
  if (!latent.valid()) return out;
  out.movement = offsets_.Apply(all_.shape.Forward(latent, mode));
  out.positions = out.movement + nn::Constant(context_, template_positions_);
  if (config_.normalize) out.positions = NormalizeMeshes(out.positions, kPredictionHalfExtent);
  if (config_.lookup) out.pose = all_.pose.Forward(latent, mode);
  Light(latent, levels.front().value(), mode, &out);
  out.textures = Texture(latent, levels, out, mode);
  if (config_.cubes && mode == nn::Mode::kEval)
    out.textures = cubes_.Maps(cubes_.Cubes(out.textures));
  return out;
}

}  // namespace tilegrad::train

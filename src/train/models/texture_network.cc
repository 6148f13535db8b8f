// SPDX-License-Identifier: Apache-2.0
#include "train/models/texture_network.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "scene/light_frame.h"

namespace tilegrad::train {
namespace {

constexpr int kResidualPairs = 3;    // of two layers: the six of section 5.2
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

// The head's initial prediction: light from the camera, or from everywhere.
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

// The third number to above 0, smoothly; 1 stays about where it is.
nn::Var Facing(const nn::Var& raw) {
  return nn::Concat({nn::Slice(raw, 1, 0, 2), nn::Softplus(nn::Slice(raw, 1, 2, 3))}, 1);
}

// Channels [first, end) of the layers' output for each texel, and of PictureLookup::Look.
struct Channels {
  std::int64_t first, end;
};
constexpr Channels kShares{0, 3};      // of picture, mirror image and made-up colour, logits
constexpr Channels kGains{3, 5};       // ln, of the picture's and the mirror image's colours
constexpr Channels kColor{5, 8};       // made up, logits
constexpr Channels kPaintShare{8, 9};  // with a palette; then a logit for each paint
constexpr Channels kUnlit{5, 6};       // of Look: ln of 1 / light
constexpr Channels kMirrorUnlit{PictureLookup::kChannels + 5, PictureLookup::kChannels + 6};

// The share of any excess above 1 that is removed; the rest keeps a gradient back to 1.
constexpr double kTooBright = 0.9;

nn::Var Take(const nn::Var& maps, const Channels& channels) {
  return nn::Slice(maps, 1, channels.first, channels.end);
}

// A frame of one pixel around a map of the sphere: left and right edges are neighbours.
nn::Var WrapAround(const nn::Var& map) {
  return nn::PadImage(map, nn::Padding::All(1), {nn::PadMode::kReplicate, nn::PadMode::kCircular});
}

constexpr double kDarkChannel = 0.03;  // of a channel; anything darker counts as unlit
constexpr double kFewTexels = 1;       // so many seen texels weigh as much as the guess
constexpr double kNoShare = 1e-3;

// [M, 4, h, w]: colours of `seen` (PictureLookup::Look) without light, and how much to trust each:
// what faces the camera, is covered by the picture's object and is lit.
nn::Tensor TrustedColors(nn::Context& context, const nn::Tensor& seen) {
  const nn::Shape& shape = seen.shape();
  nn::Tensor out = context.Empty({shape[0], 4, shape[2], shape[3]}, seen.dtype());
  nn::WithFloatType(seen.dtype(), [&]<class T>(T) {
    const auto plane = static_cast<std::size_t>(shape[2] * shape[3]);
    const auto channels = static_cast<std::size_t>(shape[1]);
    context.workers().For(static_cast<std::size_t>(shape[0]), [&](std::size_t m, std::size_t) {
      const T* in = seen.data<T>() + m * channels * plane;
      T* to = out.data<T>() + m * 4 * plane;
      for (std::size_t t = 0; t < plane; ++t) {
        const T gain = std::exp(in[5 * plane + t]);
        T brightest = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          brightest = std::max(brightest, in[c * plane + t]);
          to[c * plane + t] = std::min(T(1), in[c * plane + t] * gain);
        }
        const T facing = std::max(T(0), in[4 * plane + t]);
        to[3 * plane + t] = brightest > T(kDarkChannel) ? facing * in[3 * plane + t] / gain : T(0);
      }
    });
  });
  return out;
}

}  // namespace

Status CheckImageSize(const PictureCodeConfig& config, int image_size) {
  if (nn::CanHalve(image_size, config.levels)) return {};
  return InvalidArgument(
      "images of {} pixels a side cannot be halved {} times to at least two pixels: choose a "
      "smaller network.levels",
      image_size, config.levels);
}

void TextureNetwork::Parts::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  code->Visit(prefix, visitor);
  shape.Visit(prefix + "shape.", visitor);
  light.Visit(prefix + "light.", visitor);
  pose.Visit(prefix + "pose.", visitor);
  if (paint) paint->Visit(prefix + "paint.", visitor);
}

TextureNetwork::TextureNetwork(nn::Context& context, const TextureNetworkConfig& config,
                               const LightHeadShape& light, int image_size, std::uint64_t seed)
    : context_(context),
      config_(config),
      light_(light),
      texture_size_(image_size << config.code.enlarge),
      sphere_(context, config.sphere) {
  Rng rng(seed, /*stream=*/0x74657874);
  nn::UNetShape unet =
      UNetOf(config.code, {.in = 4,
                           .out = config.lookup ? config.lookup_width : 3,
                           .output = config.lookup ? &nn::LeakyRelu02 : &nn::Sigmoid});
  if (config.lookup) unet.enlarge = 0;
  all_.code.emplace(context, unet,
                    PictureCodeShape{.image_size = image_size, .latent = config.code.latent}, rng);
  BuildHeads(rng);
  if (config.lookup) BuildLookup(image_size, rng);
  if (config.cubes) cubes_ = FaceCubes(context, sphere_.mesh(), texture_size_);
  if (config.symmetric_texture) mirror_ = MirrorColumns(context, texture_size_);
}

void TextureNetwork::BuildHeads(Rng& rng) {
  const std::int64_t latent = config_.code.latent;
  nn::AddLinear(all_.shape, "fc1", context_, latent, config_.hidden, rng);
  all_.shape.Add<nn::Activation>("act", &nn::Relu);
  auto& offsets =
      nn::AddLinear(all_.shape, "fc2", context_, config_.hidden, sphere_.numbers(), rng);
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
  nn::AddLinear(all_.pose, "fc1", context_, config_.code.latent, config_.light_width, rng);
  all_.pose.Add<nn::Activation>("act", &nn::Relu);
  nn::AddLinear(all_.pose, "fc2", context_, config_.light_width, kPoseNumbers, rng);
  const TexturePainterShape painter{.image_size = image_size,
                                    .texture_size = texture_size_,
                                    .width = config_.lookup_width,
                                    .palette = config_.palette};
  all_.paint.emplace(context_, sphere_.mesh(), painter, rng);
}

nn::Var TextureNetwork::Texture(const PictureCode::Encoded& encoded, const Prediction& objects,
                                nn::Mode mode) {
  nn::Var image = all_.code->DecodeMap(encoded, mode);
  if (all_.paint) {
    const nn::Tensor light = objects.directions.valid() ? objects.directions.value() : nn::Tensor();
    image = all_.paint->Paint(
        image,
        {encoded.levels.front().value(), objects.positions.value(), objects.pose.value(), light},
        mode);
  }
  if (config_.symmetric_texture) image = nn::MapAxis(image, 3, mirror_);
  return nn::Permute(image, {0, 2, 3, 1});
}

void TextureNetwork::Light(const PictureCode::Encoded& encoded, nn::Mode mode, Prediction* out) {
  if (light_.lighting == Lighting::kNone) return;
  nn::Var from = encoded.latent;
  if (all_.paint) {
    const nn::Tensor cues = all_.paint->Cues(
        {encoded.levels.front().value(), out->positions.value(), out->pose.value()});
    from = nn::Concat({from, nn::Constant(context_, cues)}, 1);
  }
  nn::Var raw = all_.light.Forward(from, mode);
  if (light_.lighting == Lighting::kSphericalHarmonics) {
    out->sh = raw;
    return;
  }
  if (all_.paint) {  // the last cues are a direction, which the head corrects
    const std::int64_t cues = from.shape()[1];
    raw = raw + nn::Pad(nn::Slice(from, 1, cues - 3, cues), 1, 0, raw.shape()[1] - 3);
  }
  out->directions = UnitRows(light_.facing ? Facing(raw) : nn::Slice(raw, 1, 0, 3));
  if (light_.lighting != Lighting::kPhong) return;
  const double low = std::log(light_.shininess_low), high = std::log(light_.shininess_high);
  const nn::Var share = nn::Sigmoid(nn::Reshape(nn::Slice(raw, 1, 3, 4), {raw.shape()[0]}));
  out->shininess = nn::Exp((high - low) * share + low);
}

Prediction TextureNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  Prediction out;
  const PictureCode::Encoded encoded = all_.code->Encode(images, mode);
  if (!encoded.latent.valid()) return out;
  out.movement = sphere_.Movement(all_.shape.Forward(encoded.latent, mode));
  out.positions =
      config_.normalize ? sphere_.Normalized(out.movement) : out.movement + sphere_.Positions();
  if (config_.lookup) out.pose = all_.pose.Forward(encoded.latent, mode);
  Light(encoded, mode, &out);
  out.textures = Texture(encoded, out, mode);
  if (config_.cubes && mode == nn::Mode::kEval)
    out.textures = cubes_.Maps(cubes_.Cubes(out.textures));
  return out;
}

TexturePainter::TexturePainter(nn::Context& context, const Mesh& sphere,
                               const TexturePainterShape& shape, Rng& rng)
    : context_(context),
      shape_(shape),
      coarse_(sphere, shape.image_size),
      fine_(sphere, shape.texture_size) {
  const auto add = [&](const std::string& name, std::int64_t in, std::int64_t out) {
    layers_.Add<nn::Activation>("wrap" + name, &WrapAround);
    layers_.Add<nn::Conv2dLayer>("conv" + name, context, nn::ConvShape{.in = in, .out = out}, rng);
  };
  add("1", shape.width + 2 * PictureLookup::kChannels, shape.width);
  layers_.Add<nn::Activation>("act1", &nn::LeakyRelu02);
  add("2", shape.width, shape.width);
  layers_.Add<nn::Activation>("act2", &nn::LeakyRelu02);
  add("3", shape.width, shape.palette > 0 ? kPaintShare.end + shape.palette : kColor.end);
}

nn::Var TexturePainter::Shares(const nn::Var& raw) const {
  const nn::Var logits = Take(raw, kShares);
  return nn::Softmax(shape_.palette == 0 ? logits : nn::Concat({logits, Take(raw, kPaintShare)}, 1),
                     1);
}

nn::Var TexturePainter::MadeUp(const nn::Var& raw, const nn::Var& shares,
                               const nn::Tensor& seen) const {
  const nn::Var guess = nn::Sigmoid(Take(raw, kColor));
  nn::Var made = nn::Slice(shares, 1, 2, 3) * guess;
  if (shape_.palette == 0) return made;
  const Channels paints{kPaintShare.end, kPaintShare.end + shape_.palette};
  const nn::Var kinds = nn::Softmax(Take(raw, paints), 1);
  return made + nn::Slice(shares, 1, 3, 4) * PaletteColors(kinds, seen, guess);
}

nn::Var TexturePainter::Paint(const nn::Var& map, const PictureLookup::Job& job, nn::Mode mode) {
  const nn::Var seen = nn::Constant(context_, coarse_.Look(context_, job));
  const nn::Var raw = layers_.Forward(nn::Concat({map, seen}, 1), mode);
  const nn::Var shares = Shares(raw);
  const nn::Var unlit = nn::Concat({Take(seen, kUnlit), Take(seen, kMirrorUnlit)}, 1);
  const nn::Var looked = nn::Slice(shares, 1, 0, 2) * nn::Exp(Take(raw, kGains) + unlit);
  const nn::Var made = MadeUp(raw, shares, seen.value());
  const std::int64_t side = shape_.texture_size;
  const nn::Var all =
      nn::Resize(nn::Concat({looked, made}, 1), {side, side}, nn::ResizeMode::kBilinear);
  const nn::Var colors = nn::Constant(context_, fine_.Colors(context_, job));
  const nn::Var sum = nn::Slice(all, 1, 0, 1) * nn::Slice(colors, 1, 0, 3) +
                      nn::Slice(all, 1, 1, 2) * nn::Slice(colors, 1, 3, 6) +
                      nn::Slice(all, 1, 2, 5);
  return sum - kTooBright * nn::Relu(sum - 1.0);
}

nn::Var PaletteColors(const nn::Var& kinds, const nn::Tensor& seen, const nn::Var& guess) {
  nn::Context& context = kinds.context();
  const nn::Var trusted = nn::Constant(context, TrustedColors(context, seen));
  const nn::Var trust = nn::Slice(trusted, 1, 3, 4);
  const nn::Var weighted = trust * nn::Slice(trusted, 1, 0, 3);
  nn::Var out;
  for (std::int64_t k = 0; k < kinds.shape()[1]; ++k) {
    const nn::Var kind = nn::Slice(kinds, 1, k, k + 1);
    const auto total = [&](const nn::Var& x) { return nn::Sum(kind * x, {2, 3}, nn::Keep::kYes); };
    const nn::Var made = total(guess) / (nn::Sum(kind, {2, 3}, nn::Keep::kYes) + kNoShare);
    const nn::Var paint = (total(weighted) + kFewTexels * made) / (total(trust) + kFewTexels);
    out = k == 0 ? kind * paint : out + kind * paint;
  }
  return out;
}

}  // namespace tilegrad::train

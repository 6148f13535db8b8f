// SPDX-License-Identifier: Apache-2.0
#include "train/models/texture_painter.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::train {
namespace {

// What the layers say of each texel, and what PictureLookup::Look does: channels [first, end).
struct Channels {
  std::int64_t first, end;
};
constexpr Channels kShares{0, 3};      // of picture, mirror image and made-up colour, logits
constexpr Channels kGains{3, 5};       // ln, of the picture's and the mirror image's colours
constexpr Channels kColor{5, 8};       // made up, logits
constexpr Channels kPaintShare{8, 9};  // with a palette; then a logit for each paint
constexpr Channels kUnlit{5, 6};       // of Look: ln of 1 / light
constexpr Channels kMirrorUnlit{PictureLookup::kChannels + 5, PictureLookup::kChannels + 6};

// Of what is above 1 this share is taken off; the rest leaves a gradient that leads back.
constexpr double kTooBright = 0.9;

nn::Var Take(const nn::Var& maps, const Channels& channels) {
  return nn::Slice(maps, 1, channels.first, channels.end);
}

// A frame of one pixel around a map of the sphere: left and right edges are neighbours.
nn::Var WrapAround(const nn::Var& map) {
  return nn::Pad(nn::Pad(map, 3, 1, 1, nn::PadMode::kCircular), 2, 1, 1, nn::PadMode::kReplicate);
}

constexpr double kDarkChannel = 0.03;  // of a channel: no light reaches what is darker
constexpr double kFewTexels = 1;       // of so many a guess weighs as much as what is seen
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

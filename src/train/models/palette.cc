// SPDX-License-Identifier: Apache-2.0
#include "train/models/palette.h"

#include <algorithm>
#include <cmath>

#include "nn/nn.h"

namespace tilegrad::train {
namespace {

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

// SPDX-License-Identifier: Apache-2.0
// Scalar reference of texture_levels.h: pyramids and lookups between two levels. T: float, double,
// std::complex<double>.
#pragma once

#include <array>

#include "base/scalar.h"
#include "shade/texture_levels.h"
#include "shade/texture_ref.h"

namespace tilegrad::shade {

// The levels of a texture, [texel][channels], concatenated.
template <class T>
struct PyramidRef {
  using Real = decltype(RealPart(T()));

  TextureViewT<T> texture;
  std::vector<LevelSize> sizes;
  std::vector<T> texels;

  explicit PyramidRef(const TextureViewT<T>& t)
      : texture(t), texels(t.texels.begin(), t.texels.end()) {
    LevelSize size{t.width, t.height, 0};
    const auto channels = static_cast<std::size_t>(t.channels);
    for (int l = LevelCount(t.width, t.height, t.filter); l > 0; --l, size = NextLevel(size)) {
      sizes.push_back(size);
      texels.resize(channels * (size.first + size.texels()), T(0));
      if (sizes.size() == 1) continue;
      const auto add = [&](std::size_t to, std::size_t from, Real weight) {
        for (std::size_t c = 0; c < channels; ++c) {
          texels[channels * to + c] += T(weight) * texels[channels * from + c];
        }
      };
      ForEachCovered<Real>(*(sizes.end() - 2), size, add);
    }
  }

  // A level as a texture view into `all`, which is `texels` or an array of their gradients.
  TextureViewT<T> Level(std::size_t l) const {
    TextureViewT<T> out = texture;
    out.width = sizes[l].width;
    out.height = sizes[l].height;
    out.texels = std::span(texels).subspan(First(l), Size(l));
    return out;
  }
  std::size_t First(std::size_t l) const {
    return sizes[l].first * static_cast<std::size_t>(texture.channels);
  }
  std::size_t Size(std::size_t l) const {
    return sizes[l].texels() * static_cast<std::size_t>(texture.channels);
  }

  // Propagates the gradient of all levels to the finest.
  void Fold(std::span<T> d_texels) const {
    const auto channels = static_cast<std::size_t>(texture.channels);
    for (std::size_t l = sizes.size(); l-- > 1;) {
      const auto add = [&](std::size_t to, std::size_t from, Real weight) {
        for (std::size_t c = 0; c < channels; ++c) {
          d_texels[channels * from + c] += T(weight) * d_texels[channels * to + c];
        }
      };
      ForEachCovered<Real>(sizes[l - 1], sizes[l], add);
    }
  }
};

// The levels between which a lookup interpolates, and the weight of the coarser one.
template <class Real>
struct LevelMix {
  std::size_t fine, coarse;
  Real share;
};

template <class Real>
LevelMix<Real> MixLevels(Real level, std::size_t levels) {
  const auto most = static_cast<Real>(levels - 1);
  const Real kept = level > 0 ? std::min(level, most) : Real(0);  // NaN: the finest
  const auto fine = static_cast<std::size_t>(kept);
  return {fine, std::min(fine + 1, levels - 1), kept - static_cast<Real>(fine)};
}

// `level` as in TextureInput::level; ignored unless the filter is trilinear.
template <class T>
std::array<T, 3> SampleRef(const PyramidRef<T>& pyramid, const T& u, const T& v,
                           typename PyramidRef<T>::Real level) {
  std::array<T, 3> fine, coarse;
  const LevelMix mix = MixLevels(level, pyramid.sizes.size());
  SampleLevelRef<T>(pyramid.Level(mix.fine), u, v, fine);
  if (mix.share == 0) return fine;
  SampleLevelRef<T>(pyramid.Level(mix.coarse), u, v, coarse);
  for (std::size_t c = 0; c < 3; ++c) fine[c] += T(mix.share) * (coarse[c] - fine[c]);
  return fine;
}

// Adds to d_uv[2] and to d_texels of all levels; Fold propagates those to the finest.
template <class T>
void SampleAdjointRef(const PyramidRef<T>& pyramid, const T& u, const T& v,
                      typename PyramidRef<T>::Real level, const std::array<T, 3>& d_color,
                      std::span<T> d_uv, std::span<T> d_texels) {
  const LevelMix mix = MixLevels(level, pyramid.sizes.size());
  const auto add = [&](std::size_t l, const T& share) {
    if (share == T(0)) return;
    const std::array<T, 3> d = {share * d_color[0], share * d_color[1], share * d_color[2]};
    SampleLevelAdjointRef<T>(
        pyramid.Level(l), u, v, d, d_uv,
        d_texels.empty() ? d_texels : d_texels.subspan(pyramid.First(l), pyramid.Size(l)));
  };
  add(mix.fine, T(1) - T(mix.share));
  add(mix.coarse, T(mix.share));
}

}  // namespace tilegrad::shade

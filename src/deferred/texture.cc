// SPDX-License-Identifier: Apache-2.0
#include "deferred/texture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "deferred/band_sums.h"
#include "deferred/texture_point.h"
#include "deferred/texture_taps.h"

namespace tilegrad::deferred {
namespace {

// Levels `low` and low + 1, the weight of the second; `moves`: the weight follows the level.
struct LevelChoice {
  std::size_t low;
  double mix;
  bool moves;
};

template <class T>
LevelChoice ChooseLevel(const TextureInput<T>& input, double level) {
  const auto last = static_cast<double>(input.levels.size() - 1);
  const bool between = input.filter == TextureFilter::kLinearMipmapLinear;
  if (!(level > 0)) return {0, 0, false};
  if (level >= last) return {input.levels.size() - 1, 0, false};
  const double low = std::floor(between ? level : level + 0.5);
  return {static_cast<std::size_t>(low), between ? level - low : 0, between};
}

template <class T>
bool UsesLevels(const TextureInput<T>& input) {
  return input.filter == TextureFilter::kLinearMipmapNearest ||
         input.filter == TextureFilter::kLinearMipmapLinear;
}

// What a pixel reads.
struct PixelLookup {
  TextureCoordinates at;
  TexturePoint point;
  FootprintLevel footprint;
  LevelChoice choice;
  int levels;  // 1 or 2
  Taps taps[2];

  double share(int i) const { return i == 0 ? 1 - choice.mix : choice.mix; }
};

template <class T>
TextureCoordinates CoordinatesOf(const TextureInput<T>& input, std::size_t pixel) {
  const std::size_t n = input.coordinates();
  TextureCoordinates out{};
  for (std::size_t i = 0; i < n; ++i) out.uv[i] = static_cast<double>(input.uv[n * pixel + i]);
  for (std::size_t i = 0; i < 2 * n && !input.uv_da.empty(); ++i) {
    out.uv_da[i] = static_cast<double>(input.uv_da[2 * n * pixel + i]);
  }
  return out;
}

template <class T>
void SetLevel(const TextureInput<T>& input, std::size_t pixel, PixelLookup* lookup) {
  double level = 0;
  if (!input.uv_da.empty()) {
    lookup->footprint = LevelOf(lookup->point.slopes, input.levels[0].size);
    level = lookup->footprint.level;
  }
  if (!input.mip_level_bias.empty()) level += static_cast<double>(input.mip_level_bias[pixel]);
  lookup->choice = ChooseLevel(input, level);
}

template <class T>
PixelLookup LookupOf(const TextureInput<T>& input, std::size_t pixel) {
  PixelLookup out{};
  out.at = CoordinatesOf(input, pixel);
  out.point = PointOf(out.at, input.boundary == TextureBoundary::kCube);
  if (!out.point.valid) return out;
  if (UsesLevels(input)) SetLevel(input, pixel, &out);
  out.levels = out.choice.mix > 0 || out.choice.moves ? 2 : 1;
  for (int i = 0; i < out.levels; ++i) {
    out.taps[i] = TapsOf(out.point, input.levels[out.choice.low + static_cast<std::size_t>(i)].size,
                         input.filter == TextureFilter::kNearest, input.boundary);
  }
  return out;
}

std::size_t TexelsOf(const MipSize& size, std::size_t faces) {
  return faces * static_cast<std::size_t>(size.height) * static_cast<std::size_t>(size.width);
}

// The texels of one level of the texture that an image has.
template <class T>
const T* TexelsFor(const TextureInput<T>& input, std::size_t level, std::size_t image) {
  const TextureLevel<T>& l = input.levels[level];
  const std::size_t texture = input.textures == 1 ? 0 : image;
  return l.texels.data() + texture * TexelsOf(l.size, input.faces()) * input.channels;
}

// One channel of what stands at the taps.
template <class T>
void ReadTaps(const Taps& taps, const T* texels, std::size_t channels, std::size_t channel,
              double (&values)[4]) {
  double sum = 0;
  int mean = -1;
  for (int k = 0; k < taps.count; ++k) {
    const std::ptrdiff_t texel = taps.texel[k];
    values[k] =
        texel < 0
            ? 0
            : static_cast<double>(texels[static_cast<std::size_t>(texel) * channels + channel]);
    sum += values[k];
    if (texel == Taps::kMean) mean = k;
  }
  if (mean >= 0) values[mean] = sum / 3;
}

double MixTaps(const Taps& taps, const double (&v)[4]) {
  if (taps.count == 1) return v[0];
  const double lower = v[0] + taps.a * (v[1] - v[0]), upper = v[2] + taps.a * (v[3] - v[2]);
  return lower + taps.b * (upper - lower);
}

template <class T>
void SamplePixel(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                 T* out) {
  for (std::size_t c = 0; c < input.channels; ++c) {
    double sum = 0, values[4];
    for (int i = 0; i < lookup.levels; ++i) {
      const T* texels = TexelsFor(input, lookup.choice.low + static_cast<std::size_t>(i), image);
      ReadTaps(lookup.taps[i], texels, input.channels, c, values);
      sum += lookup.share(i) * MixTaps(lookup.taps[i], values);
    }
    out[c] = static_cast<T>(sum);
  }
}

// What the cotangent of a pixel pulls on a, b and on the mixture of levels.
struct PixelPull {
  double d_st[2] = {}, d_mix = 0;
};

template <class T>
PixelPull PullPoint(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                    const T* d_out) {
  PixelPull pull;
  for (int i = 0; i < lookup.levels; ++i) {
    const Taps& taps = lookup.taps[i];
    const T* texels = TexelsFor(input, lookup.choice.low + static_cast<std::size_t>(i), image);
    double d_a = 0, d_b = 0, d_share = 0, v[4];
    for (std::size_t c = 0; c < input.channels; ++c) {
      const auto d = static_cast<double>(d_out[c]);
      ReadTaps(taps, texels, input.channels, c, v);
      d_share += d * MixTaps(taps, v);
      if (taps.count == 1) continue;
      d_a += d * ((1 - taps.b) * (v[1] - v[0]) + taps.b * (v[3] - v[2]));
      d_b += d * ((1 - taps.a) * (v[2] - v[0]) + taps.a * (v[3] - v[1]));
    }
    pull.d_st[0] += lookup.share(i) * d_a * taps.slope_a;
    pull.d_st[1] += lookup.share(i) * d_b * taps.slope_b;
    pull.d_mix += i == 0 ? -d_share : d_share;
  }
  return pull;
}

// Adds what one tap pulls to its texel.
template <class T>
void PullTexel(const TextureInput<T>& input, std::size_t row, double weight, const T* d_out,
               BandSums::Adder* adder) {
  if (weight == 0) return;
  double* to = adder->Row(row);
  for (std::size_t c = 0; c < input.channels; ++c) to[c] += weight * static_cast<double>(d_out[c]);
}

template <class T>
void PullTexels(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                std::span<const std::size_t> first, const T* d_out, BandSums::Adder* adder) {
  for (int i = 0; i < lookup.levels; ++i) {
    const std::size_t level = lookup.choice.low + static_cast<std::size_t>(i);
    const std::size_t texture = input.textures == 1 ? 0 : image;
    const std::size_t base =
        first[level] + texture * TexelsOf(input.levels[level].size, input.faces());
    const Taps& taps = lookup.taps[i];
    double shared = 0;  // by the three texels at a corner of a cube
    for (int k = 0; k < taps.count; ++k) {
      if (taps.texel[k] == Taps::kMean) shared = taps.weight(k) / 3;
    }
    for (int k = 0; k < taps.count; ++k) {
      if (taps.texel[k] < 0) continue;
      PullTexel(input, base + static_cast<std::size_t>(taps.texel[k]),
                lookup.share(i) * (taps.weight(k) + shared), d_out, adder);
    }
  }
}

template <class T>
void WriteCoordinates(const TextureInput<T>& input, const PixelLookup& lookup,
                      const PixelPull& pull, std::size_t pixel, const TextureGradients<T>& out) {
  const double d_level = lookup.choice.moves ? pull.d_mix : 0;
  if (!out.d_mip_level_bias.empty()) out.d_mip_level_bias[pixel] = static_cast<T>(d_level);
  PointCotangent d{{pull.d_st[0], pull.d_st[1]}, {}};
  for (int i = 0; i < 4; ++i) d.d_slopes[i] = d_level * lookup.footprint.d_slopes[i];
  TextureCoordinates to;
  PointAdjoint(lookup.at, lookup.point, input.boundary == TextureBoundary::kCube, d, &to);
  const std::size_t n = input.coordinates();
  for (std::size_t i = 0; i < n && !out.d_uv.empty(); ++i) {
    out.d_uv[n * pixel + i] = static_cast<T>(to.uv[i]);
  }
  for (std::size_t i = 0; i < 2 * n && !out.d_uv_da.empty(); ++i) {
    out.d_uv_da[2 * n * pixel + i] = static_cast<T>(to.uv_da[i]);
  }
}

// The levels one after the other: where the texels of each begin, and how many there are in all.
template <class T>
std::vector<std::size_t> LevelStarts(const TextureInput<T>& input) {
  std::vector<std::size_t> out = {0};
  for (const TextureLevel<T>& level : input.levels) {
    out.push_back(out.back() + input.textures * TexelsOf(level.size, input.faces()));
  }
  return out;
}

}  // namespace

template <class T>
void SampleTexture(const TextureInput<T>& input, const Workers& workers, std::span<T> out) {
  workers.For(input.grid.bands(), [&](std::size_t index, std::size_t) {
    const Band band = input.grid.band(index);
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      SamplePixel(input, LookupOf(input, pixel), band.image, out.data() + pixel * input.channels);
    });
  });
}

template <class T>
void SampleTextureBackward(const TextureInput<T>& input, std::span<const T> d_out,
                           const Workers& workers, const TextureGradients<T>& out) {
  const std::vector<std::size_t> first = LevelStarts(input);
  const bool texels = !out.d_levels.empty();
  const bool coordinates =
      !out.d_uv.empty() || !out.d_uv_da.empty() || !out.d_mip_level_bias.empty();
  for (const auto& gradient : {out.d_uv, out.d_uv_da, out.d_mip_level_bias}) {
    std::fill(gradient.begin(), gradient.end(), T(0));
  }
  BandSums sums(texels ? first.back() : 0, input.channels, input.grid.bands(), workers);
  workers.For(input.grid.bands(), [&](std::size_t index, std::size_t worker) {
    BandSums::Adder adder(&sums, index, worker);
    const Band band = input.grid.band(index);
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      const PixelLookup lookup = LookupOf(input, pixel);
      if (!lookup.point.valid) return;
      const T* d = &d_out[pixel * input.channels];
      if (texels) PullTexels(input, lookup, band.image, first, d, &adder);
      if (!coordinates) return;
      WriteCoordinates(input, lookup, PullPoint(input, lookup, band.image, d), pixel, out);
    });
  });
  for (std::size_t l = 0; l < out.d_levels.size(); ++l) {
    std::fill(out.d_levels[l].begin(), out.d_levels[l].end(), T(0));
    sums.AddTo(out.d_levels[l], workers, first[l]);
  }
}

#define TILEGRAD_INSTANTIATE(T)                                                                   \
  template void SampleTexture(const TextureInput<T>&, const Workers&, std::span<T>);              \
  template void SampleTextureBackward(const TextureInput<T>&, std::span<const T>, const Workers&, \
                                      const TextureGradients<T>&);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::deferred

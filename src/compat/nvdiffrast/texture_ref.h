// SPDX-License-Identifier: Apache-2.0
// Scalar reference of texture.h: pixel by pixel, in double. T: float, double.
#pragma once

#include <algorithm>
#include <cmath>

#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_taps.h"

namespace tilegrad::compat::nvdiffrast {
namespace texture_ref {

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
  const double low = std::floor(level);
  return {static_cast<std::size_t>(low), between ? level - low : 0, between};
}

template <class T>
bool UsesLevels(const TextureInput<T>& input) {
  return input.filter == TextureFilter::kLinearMipmapNearest ||
         input.filter == TextureFilter::kLinearMipmapLinear;
}

// The texels that a pixel reads.
struct PixelLookup {
  TextureCoordinates at;
  TexturePoint point;
  LevelChoice choice;
  int levels;  // 1 or 2
  Taps taps[2];

  double share(int i) const { return i == 0 ? 1 - choice.mix : choice.mix; }
};

// Leaves derivatives unchanged if none are given.
template <class T>
void SetCoordinates(const TextureInput<T>& input, std::size_t pixel, TextureCoordinates* out) {
  const std::size_t n = input.coordinates();
  for (std::size_t i = 0; i < n; ++i) out->uv[i] = static_cast<double>(input.uv[n * pixel + i]);
  if (input.uv_da.empty()) return;
  const T* da = &input.uv_da[2 * n * pixel];
  for (std::size_t i = 0; i < 2 * n; ++i) out->uv_da[i] = static_cast<double>(da[i]);
}

template <class T>
LevelChoice LevelAt(const TextureInput<T>& input, std::size_t pixel, const TexturePoint& point) {
  if (!UsesLevels(input)) return {0, 0, false};
  double level = input.uv_da.empty() ? 0 : LevelOf(point.slopes, input.levels[0].size);
  if (!input.mip_level_bias.empty()) level += static_cast<double>(input.mip_level_bias[pixel]);
  return ChooseLevel(input, level);
}

// *out is the lookup of another pixel of this input, or empty.
template <class T>
void LookUp(const TextureInput<T>& input, std::size_t pixel, PixelLookup* out) {
  SetCoordinates(input, pixel, &out->at);
  FindPoint(out->at, input.boundary == TextureBoundary::kCube, &out->point);
  out->levels = 0;
  if (!out->point.valid) return;
  out->choice = LevelAt(input, pixel, out->point);
  out->levels = out->choice.moves ? 2 : 1;
  for (int i = 0; i < out->levels; ++i) {
    FindTaps(out->point, input.levels[out->choice.low + static_cast<std::size_t>(i)].size,
             input.filter == TextureFilter::kNearest, input.boundary, &out->taps[i]);
  }
}

// The first texel of an image's texture in a level.
template <class T>
std::size_t FirstTexel(const TextureInput<T>& input, std::size_t level, std::size_t image) {
  return (input.textures == 1 ? 0 : image) * TexelsOf(input.levels[level].size, input.faces());
}

// The texels of one level that a lookup mixes. At the corner of a cube the others share the missing
// texel's weight; texels outside are dropped.
struct WeightedTexels {
  int count;
  std::size_t texel[4];  // of the level
  double weight[4];
};

template <class T>
void FindTexels(const TextureInput<T>& input, const PixelLookup& lookup, int i, std::size_t image,
                WeightedTexels* out) {
  const Taps& taps = lookup.taps[i];
  const std::size_t first =
      FirstTexel(input, lookup.choice.low + static_cast<std::size_t>(i), image);
  out->count = 0;
  double shared = 0;
  for (int k = 0; k < taps.count; ++k) {
    if (taps.texel[k] == Taps::kMean) shared = taps.weight(k) / 3;
  }
  for (int k = 0; k < taps.count; ++k) {
    if (taps.texel[k] < 0) continue;
    out->texel[out->count] = first + static_cast<std::size_t>(taps.texel[k]);
    out->weight[out->count++] = lookup.share(i) * (taps.weight(k) + shared);
  }
}

template <class T>
const T* LevelTexels(const TextureInput<T>& input, const PixelLookup& lookup, int i) {
  return input.levels[lookup.choice.low + static_cast<std::size_t>(i)].texels.data();
}

constexpr std::size_t kSumChannels = 8;  // summed in parallel

// out[c] <- the texels' mix in channels first to first + n - 1, n at most kSumChannels.
template <class T>
void MixChannels(const TextureInput<T>& input, const PixelLookup& lookup,
                 const WeightedTexels (&texels)[2], std::size_t first, std::size_t n, T* out) {
  double sums[kSumChannels] = {};
  for (int i = 0; i < lookup.levels; ++i) {
    const T* from = LevelTexels(input, lookup, i) + first;
    for (int k = 0; k < texels[i].count; ++k) {
      const T* texel = from + texels[i].texel[k] * input.channels;
      for (std::size_t c = 0; c < n; ++c) {
        sums[c] += texels[i].weight[k] * static_cast<double>(texel[c]);
      }
    }
  }
  for (std::size_t c = 0; c < n; ++c) out[c] = static_cast<T>(sums[c]);
}

template <class T>
void SamplePixel(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                 T* out) {
  WeightedTexels texels[2];
  for (int i = 0; i < lookup.levels; ++i) FindTexels(input, lookup, i, image, &texels[i]);
  for (std::size_t c = 0; c < input.channels; c += kSumChannels) {
    const std::size_t n = std::min(kSumChannels, input.channels - c);
    MixChannels(input, lookup, texels, c, n, out + c);
  }
}

// Gradients of a pixel by s and t, and by the mix of levels.
struct PixelPull {
  double d_st[2] = {}, d_mix = 0;
};

// The product of each tap's texel with the cotangent.
template <class T>
void DotTaps(const TextureInput<T>& input, const Taps& taps, const T* texels, const T* d_out,
             double (&dots)[4]) {
  double sum = 0;
  int mean = -1;
  for (int k = 0; k < taps.count; ++k) {
    dots[k] = 0;
    if (taps.texel[k] == Taps::kMean) mean = k;
    if (taps.texel[k] < 0) continue;
    const T* texel = texels + static_cast<std::size_t>(taps.texel[k]) * input.channels;
    for (std::size_t c = 0; c < input.channels; ++c) {
      dots[k] += static_cast<double>(texel[c]) * static_cast<double>(d_out[c]);
    }
    sum += dots[k];
  }
  if (mean >= 0) dots[mean] = sum / 3;
}

template <class T>
PixelPull PullPoint(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                    const T* d_out) {
  PixelPull pull;
  for (int i = 0; i < lookup.levels; ++i) {
    const Taps& taps = lookup.taps[i];
    const std::size_t level = lookup.choice.low + static_cast<std::size_t>(i);
    const T* texels =
        input.levels[level].texels.data() + FirstTexel(input, level, image) * input.channels;
    double dots[4], d_share = 0;
    DotTaps(input, taps, texels, d_out, dots);
    for (int k = 0; k < taps.count; ++k) d_share += taps.weight(k) * dots[k];
    pull.d_mix += i == 0 ? -d_share : d_share;
    if (taps.count == 1) continue;
    const double d_a = (1 - taps.b) * (dots[1] - dots[0]) + taps.b * (dots[3] - dots[2]);
    const double d_b = (1 - taps.a) * (dots[2] - dots[0]) + taps.a * (dots[3] - dots[1]);
    pull.d_st[0] += lookup.share(i) * d_a * taps.slope_a;
    pull.d_st[1] += lookup.share(i) * d_b * taps.slope_b;
  }
  return pull;
}

// `first`: offsets of the levels among all texels.
template <class T>
void PullTexels(const TextureInput<T>& input, const PixelLookup& lookup, std::size_t image,
                std::span<const std::size_t> first, const T* d_out, BandSums::Adder* adder) {
  for (int i = 0; i < lookup.levels; ++i) {
    WeightedTexels texels;
    FindTexels(input, lookup, i, image, &texels);
    const std::size_t begin = first[lookup.choice.low + static_cast<std::size_t>(i)];
    for (int k = 0; k < texels.count; ++k) {
      double* to = adder->Row(begin + texels.texel[k]);
      for (std::size_t c = 0; c < input.channels; ++c) {
        to[c] += texels.weight[k] * static_cast<double>(d_out[c]);
      }
    }
  }
}

template <class T>
void WriteCoordinates(const TextureInput<T>& input, const PixelLookup& lookup,
                      const PixelPull& pull, std::size_t pixel, const TextureGradients<T>& out) {
  const double d_level = lookup.choice.moves ? pull.d_mix : 0;
  if (!out.d_mip_level_bias.empty()) out.d_mip_level_bias[pixel] = static_cast<T>(d_level);
  PointCotangent d{{pull.d_st[0], pull.d_st[1]}, {}};
  if (!input.uv_da.empty() && d_level != 0) {
    LevelAdjoint(lookup.point.slopes, input.levels[0].size, d_level, d.d_slopes);
  }
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

// Offsets of the levels in one array of all texels, and the total number.
template <class T>
std::vector<std::size_t> LevelStarts(const TextureInput<T>& input) {
  std::vector<std::size_t> out = {0};
  for (const TextureLevel<T>& level : input.levels) {
    out.push_back(out.back() + input.textures * TexelsOf(level.size, input.faces()));
  }
  return out;
}

}  // namespace texture_ref

template <class T>
void SampleTextureRef(const TextureInput<T>& input, const Workers& workers, std::span<T> out) {
  using namespace texture_ref;
  workers.For(input.grid.bands(), [&](std::size_t index) {
    const Band band = input.grid.band(index);
    PixelLookup lookup{};
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      LookUp(input, pixel, &lookup);
      SamplePixel(input, lookup, band.image, out.data() + pixel * input.channels);
    });
  });
}

template <class T>
void SampleTextureBackwardRef(const TextureInput<T>& input, std::span<const T> d_out,
                              const Workers& workers, const TextureGradients<T>& out) {
  using namespace texture_ref;
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
    PixelLookup lookup{};
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      const T* d = &d_out[pixel * input.channels];
      // Mostly the background, which samples the texel at (0, 0) and is masked afterwards.
      if (std::all_of(d, d + input.channels, [](T v) { return v == T(0); })) return;
      LookUp(input, pixel, &lookup);
      if (!lookup.point.valid) return;
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

}  // namespace tilegrad::compat::nvdiffrast

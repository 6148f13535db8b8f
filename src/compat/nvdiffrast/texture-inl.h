// SPDX-License-Identifier: Apache-2.0
// Vector body of texture.h, forward. Computes texel addresses for runs of pixels, with pixels as
// lanes (texture_taps-inl.h); reads texels as quads, with channels as lanes (quads-inl.h).
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "base/prefetch.h"
#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_taps-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {

inline constexpr std::size_t kMostLevels = 33;

// The levels of an image's texture, and the last numbers of each padded with zeros, from which
// quads of the last texels are loaded.
struct ImageLevels {
  static constexpr std::size_t kTail = 4;

  const float *at[kMostLevels], *end[kMostLevels];
  float tails[kMostLevels][2 * kTail];
  std::size_t channels;

  HWY_INLINE ImageLevels(const TextureInput<float>& input, std::size_t image)
      : channels(input.channels) {
    for (std::size_t l = 0; l < input.levels.size(); ++l) {
      const std::size_t numbers = TexelsOf(input.levels[l].size, input.faces()) * channels;
      at[l] = input.levels[l].texels.data() + (input.textures == 1 ? 0 : image) * numbers;
      end[l] = at[l] + numbers;
      const std::size_t some = HWY_MIN(numbers, kTail);
      std::fill(std::copy(end[l] - some, end[l], tails[l] + kTail - some), tails[l] + 2 * kTail,
                0.0f);
    }
  }
  // Channels c to c + 3 of a texel; zeros after the end of the level.
  HWY_INLINE Quad Load(std::size_t level, std::int32_t texel, std::size_t c) const {
    const float* from = at[level] + static_cast<std::size_t>(texel) * channels + c;
    const auto left = static_cast<std::size_t>(end[level] - from);
    return hn::LoadU(kQuad, left < kTail ? tails[level] + kTail - left : from);
  }
};

// Channels c to c + 3 of four taps.
struct TapQuads {
  Quad t[4];
};

// The same where some of the taps are no texels.
inline HWY_NOINLINE TapQuads LoadSomeTaps(const ImageLevels& levels, std::size_t level,
                                          const std::int32_t* texels, std::size_t c) {
  TapQuads out;
  Quad sum = hn::Zero(kQuad);
  int mean = -1;
  for (int k = 0; k < 4; ++k) {
    const std::int32_t texel = texels[k];
    if (texel == Taps::kMean) mean = k;
    out.t[k] = texel < 0 ? hn::Zero(kQuad) : levels.Load(level, texel, c);
    sum = hn::Add(sum, out.t[k]);
  }
  if (mean >= 0) out.t[mean] = hn::Mul(sum, hn::Set(kQuad, 1.0f / 3));
  return out;
}

// Returned, so that the usual case stays in registers.
HWY_INLINE TapQuads LoadTaps(const ImageLevels& levels, const TapRun& taps, std::size_t p,
                             std::size_t c) {
  const auto level = static_cast<std::size_t>(taps.level[p]);
  const std::int32_t* texels = taps.texel[p];
  TapQuads out;
  if (HWY_LIKELY(taps.whole[p] >= 0)) {
    const float* from = levels.at[level] + c;
    for (int k = 0; k < 4; ++k) {
      const auto texel = static_cast<std::size_t>(texels[k]);
      out.t[k] = hn::LoadU(kQuad, from + texel * levels.channels);
    }
    return out;
  }
  if ((texels[0] | texels[1] | texels[2] | texels[3]) < 0) {
    return LoadSomeTaps(levels, level, texels, c);
  }
  // Near the end of a level, as background pixels are, which look at (0, 0).
  for (int k = 0; k < 4; ++k) out.t[k] = levels.Load(level, texels[k], c);
  return out;
}

// Prefetches the texels of the pixel kAhead pixels after p: textures are larger than caches, and
// the addresses are known by then. levels: as ImageLevels::at; count: pixels of the run.
inline constexpr std::size_t kAhead = 16;
template <class Number>
HWY_INLINE void FetchAhead(Number* const* levels, std::size_t channels, const LookupRun& run,
                           std::size_t p, std::size_t count) {
  if (p + kAhead >= count) return;
  for (int i = 0; i < (run.mixes ? 2 : 1); ++i) {
    const TapRun& taps = run.taps[i];
    const std::int32_t level = taps.level[p + kAhead], *texel = taps.texel[p + kAhead];
    if (level < 0 || HWY_MIN(texel[0], texel[2]) < 0) continue;
    Number* at = levels[static_cast<std::size_t>(level)];
    PrefetchLine(at + static_cast<std::size_t>(texel[0]) * channels);
    PrefetchLine(at + static_cast<std::size_t>(texel[2]) * channels);
  }
}

// Calls visit(first pixel, count) for the runs of a band, in order.
template <class Visit>
HWY_INLINE void ForRuns(const TextureInput<float>& input, const Band& band, const Visit& visit) {
  const std::size_t end = input.grid.first(band.image, band.row_end);
  for (std::size_t p = input.grid.first(band.image, band.row_begin); p < end; p += kRun) {
    visit(p, HWY_MIN(kRun, end - p));
  }
}

HWY_INLINE Quad Mixture(const TapQuads& q, const float (&weight)[4], Quad sum) {
  for (int k = 0; k < 4; ++k) sum = hn::MulAdd(hn::Set(kQuad, weight[k]), q.t[k], sum);
  return sum;
}

// What the pixels of a run read: a texel, four of a level, or four of two levels.
enum class Reads { kTexel, kLevel, kTwoLevels };

// kOneQuad: there are at most four channels.
template <Reads kReads, bool kOneQuad>
HWY_INLINE void SamplePixels(const ImageLevels& levels, const LookupRun& run, std::size_t count,
                             float* out, const float* end) {
  const std::size_t n = levels.channels;
  for (std::size_t p = 0; p < count; ++p) {
    float* to = out + p * n;
    FetchAhead(levels.at, n, run, p, count);
    for (std::size_t c = 0; c < (kOneQuad ? 4 : n); c += 4) {
      const TapQuads fine = LoadTaps(levels, run.taps[0], p, c);
      if (kReads == Reads::kTexel) {
        StoreQuad(fine.t[0], to + c, end);
        continue;
      }
      Quad sum = Mixture(fine, run.taps[0].weight[p], hn::Zero(kQuad));
      if (kReads == Reads::kTwoLevels && run.taps[1].level[p] >= 0) {
        sum = Mixture(LoadTaps(levels, run.taps[1], p, c), run.taps[1].weight[p], sum);
      }
      StoreQuad(sum, to + c, end);
    }
  }
}

template <Reads kReads>
HWY_INLINE void SamplePixels(const ImageLevels& levels, const LookupRun& run, std::size_t count,
                             float* out, const float* end) {
  if (levels.channels <= 4) return SamplePixels<kReads, true>(levels, run, count, out, end);
  SamplePixels<kReads, false>(levels, run, count, out, end);
}

// Pixels first to first + count - 1, count at most kRun.
HWY_INLINE void SampleRun(const TextureInput<float>& input, const ImageLevels& levels,
                          std::size_t first, std::size_t count, std::span<float> out,
                          const float* end) {
  const RunCoordinates at(input, first, count);
  LookupRun run;
  LookUp(input, at, &run);
  float* to = out.data() + first * levels.channels;
  if (input.filter == TextureFilter::kNearest) {
    SamplePixels<Reads::kTexel>(levels, run, count, to, end);
  } else if (run.mixes) {
    SamplePixels<Reads::kTwoLevels>(levels, run, count, to, end);
  } else {
    SamplePixels<Reads::kLevel>(levels, run, count, to, end);
  }
}

void SampleBand(const TextureInput<float>& input, const Band& band, std::span<float> out) {
  const ImageLevels levels(input, band.image);
  const float* end = out.data() + input.grid.first(band.image, band.row_end) * input.channels;
  ForRuns(input, band, [&](std::size_t first, std::size_t count) HWY_ATTR {
    SampleRun(input, levels, first, count, out, end);
  });
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

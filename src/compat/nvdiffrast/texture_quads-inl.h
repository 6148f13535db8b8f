// SPDX-License-Identifier: Apache-2.0
// What a run of pixels reads and what it pulls: lanes are channels (quads-inl.h).
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_QUADS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_QUADS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_QUADS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_QUADS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/prefetch.h"
#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_taps-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr std::size_t kMostLevels = 33;

// The levels of the texture that an image has, and the last numbers of each with zeros after them:
// quads of the last texels are read there.
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
  // From `from` on, which is before the end.
  HWY_INLINE Quad Load(std::size_t level, const float* from) const {
    const auto left = static_cast<std::size_t>(end[level] - from);
    return hn::LoadU(QuadTag(), left < kTail ? tails[level] + kTail - left : from);
  }
};

// Channels c to c + 3 of four taps.
struct TapQuads {
  Quad t[4];

  HWY_INLINE TapQuads(const ImageLevels& levels, const TapRun& taps, std::size_t p, std::size_t c) {
    const auto level = static_cast<std::size_t>(taps.level[p]);
    const float* from = levels.at[level] + c;
    if (HWY_UNLIKELY(taps.whole[p] < 0)) {
      LoadSome(from, level, levels, taps, p);
      return;
    }
    for (int k = 0; k < 4; ++k) {
      t[k] =
          hn::LoadU(QuadTag(), from + static_cast<std::size_t>(taps.texel[p][k]) * levels.channels);
    }
  }

 private:
  HWY_NOINLINE void LoadSome(const float* from, std::size_t level, const ImageLevels& levels,
                             const TapRun& taps, std::size_t p) {
    const QuadTag d;
    Quad sum = hn::Zero(d);
    int mean = -1;
    for (int k = 0; k < 4; ++k) {
      const std::int32_t texel = taps.texel[p][k];
      if (texel == Taps::kMean) mean = k;
      t[k] = texel < 0
                 ? hn::Zero(d)
                 : levels.Load(level, from + static_cast<std::size_t>(texel) * levels.channels);
      sum = hn::Add(sum, t[k]);
    }
    if (mean >= 0) t[mean] = hn::Mul(sum, hn::Set(d, 1.0f / 3));
  }
};

// Fetches what the pixel kAhead pixels after p reads: textures are larger than caches, and where
// their texels are is known by then. levels: as ImageLevels::at; count: pixels of the run.
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

// Whether a pixel's cotangent has a number other than 0. Mostly the background has none, which
// shows whatever stands at (0, 0) and is masked afterwards.
HWY_INLINE bool HasCotangent(const float* d_out, std::size_t n, const float* end) {
  for (std::size_t c = 0; c < n; c += 4) {
    const auto some = hn::Ne(LoadQuad(d_out + c, end), hn::Zero(QuadTag()));
    if (!hn::AllFalse(QuadTag(), hn::And(some, LanesBelow(c, n)))) return true;
  }
  return false;
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of texture.h. Computes texel addresses for runs of pixels, with pixels as lanes
// (texture_taps-inl.h); reads texels as quads, with channels as lanes.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "base/prefetch.h"
#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_taps-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Texel reads and gradients of a run of pixels: lanes are channels (quads-inl.h).

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
  // Loads four numbers from `from` on, which is before the end.
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

// Whether a pixel's cotangent has a nonzero number. Mostly the background has none: it samples the
// texel at (0, 0) and is masked afterwards.
HWY_INLINE bool HasCotangent(const float* d_out, std::size_t n, const float* end) {
  for (std::size_t c = 0; c < n; c += 4) {
    const auto some = hn::Ne(LoadQuad(d_out + c, end), hn::Zero(QuadTag()));
    if (!hn::AllFalse(QuadTag(), hn::And(some, LanesBelow(c, n)))) return true;
  }
  return false;
}

// The gradient of texels.

// Sums into the texels of an image's texture, of which this call owns a part: every parts-th block
// of kBlock texels of a level. Quads that would reach beyond a block are added number by number.
class TexelSums {
 public:
  static constexpr std::uint32_t kBlock = 64;

  HWY_INLINE TexelSums(const TextureInput<float>& input, const TexelPart& part,
                       float* const* levels)
      : levels_(levels), channels_(input.channels), part_(part) {
    for (std::size_t l = 0; l < input.levels.size(); ++l) {
      ends_[l] = levels[l] + TexelsOf(input.levels[l].size, input.faces()) * channels_;
    }
  }
  std::size_t channels() const { return channels_; }
  // Adds v to channels from `first` on; v is 0 beyond the last channel.
  HWY_INLINE void Add(std::size_t level, std::int32_t texel, std::size_t first, Quad v) const {
    const QuadTag d;
    const std::uint32_t block = static_cast<std::uint32_t>(texel) / kBlock;
    if (texel < 0 || (part_.parts > 1 && block % part_.parts != part_.part)) return;
    float* to = levels_[level] + static_cast<std::size_t>(texel) * channels_ + first;
    const float* of_block = levels_[level] + (std::size_t{block} + 1) * kBlock * channels_;
    if (HWY_UNLIKELY(HWY_MIN(of_block, ends_[level]) - to < 4)) {
      return AddSome(to, HWY_MIN(channels_ - first, std::size_t{4}), v);
    }
    hn::StoreU(Finite(hn::Add(hn::LoadU(d, to), v)), d, to);
  }

 private:
  // Clamps sums to finite values; NaN stays.
  static HWY_INLINE Quad Finite(Quad sum) {
    const QuadTag d;
    const Quad most = hn::Set(d, std::numeric_limits<float>::max());
    const Quad capped = hn::IfThenElse(hn::Gt(sum, most), most, sum);
    return hn::IfThenElse(hn::Lt(capped, hn::Neg(most)), hn::Neg(most), capped);
  }
  static HWY_NOINLINE void AddSome(float* to, std::size_t n, Quad v) {
    const QuadTag d;
    HWY_ALIGN float some[4] = {};
    std::copy(to, to + n, some);
    hn::Store(Finite(hn::Add(hn::Load(d, some), v)), d, some);
    std::copy(some, some + n, to);
  }

  float* const* levels_;
  const float* ends_[kMostLevels];
  std::size_t channels_;
  TexelPart part_;
};

// Contributions of consecutive pixels that read the same texels, on up to four channels of each.
class CellSums {
 public:
  HWY_INLINE explicit CellSums(const TexelSums& to) : to_(to) {
    for (Quad& s : sum_) s = hn::Zero(QuadTag());
  }

  HWY_INLINE void Add(const TapRun& taps, std::size_t p, Quad g) {
    const hn::RebindToSigned<QuadTag> di;
    const QuadTag d;
    const auto texel = hn::Load(di, taps.texel[p]);
    if (pixels_ == kMostRun || taps.level[p] != level_ ||
        !hn::AllTrue(di, hn::Eq(texel, hn::Load(di, texel_)))) {
      Flush();
      hn::Store(texel, di, texel_);
      level_ = taps.level[p];
    }
    ++pixels_;
    for (int k = 0; k < 4; ++k) sum_[k] = hn::MulAdd(hn::Set(d, taps.weight[p][k]), g, sum_[k]);
  }
  HWY_INLINE void Flush() {
    const QuadTag d;
    if (level_ >= 0) {
      for (int mean = 0; mean < 4; ++mean) {
        if (HWY_LIKELY(texel_[mean] != Taps::kMean)) continue;
        const Quad third = hn::Mul(sum_[mean], hn::Set(d, 1.0f / 3));
        for (Quad& s : sum_) s = hn::Add(s, third);
      }
      for (int k = 0; k < 4; ++k) {
        to_.Add(static_cast<std::size_t>(level_), texel_[k], 0, sum_[k]);
      }
    }
    for (Quad& s : sum_) s = hn::Zero(d);
    level_ = -1;
    pixels_ = 0;
  }

 private:
  const TexelSums& to_;
  std::int32_t level_ = -1;
  int pixels_ = 0;
  HWY_ALIGN std::int32_t texel_[4] = {};
  Quad sum_[4];
};

// Up to four numbers of a pixel's n, from number c on; then zeros.
HWY_INLINE Quad CotangentQuad(const float* g, std::size_t c, std::size_t n, const float* end) {
  return hn::IfThenElseZero(LanesBelow(c, n), LoadQuad(g + c, end));
}

// A pixel of more than four channels.
HWY_INLINE void AddManyChannels(const TapRun& taps, std::size_t p, const float* g, const float* end,
                                const TexelSums& sums) {
  const std::int32_t* texel = taps.texel[p];
  float mean = 0;
  for (int k = 0; k < 4; ++k) mean += texel[k] == Taps::kMean ? taps.weight[p][k] / 3 : 0.0f;
  for (int k = 0; k < 4; ++k) {
    const Quad weight = hn::Set(QuadTag(), taps.weight[p][k] + mean);
    for (std::size_t c = 0; c < sums.channels(); c += 4) {
      sums.Add(static_cast<std::size_t>(taps.level[p]), texel[k], c,
               hn::Mul(weight, CotangentQuad(g, c, sums.channels(), end)));
    }
  }
}

// Adds the gradients of a band's pixels to the texels of `part`, in pixel order. d_levels: those of
// the image's texture.
void PullTexelsOfBand(const TextureInput<float>& input, const Band& band,
                      std::span<const float> d_out, const TexelPart& part, float* const* d_levels) {
  const TexelSums sums(input, part, d_levels);
  const std::size_t n = input.channels;
  const float* end = d_out.data() + d_out.size();
  LookupRun run;
  CellSums cells[2] = {CellSums(sums), CellSums(sums)};
  ForRuns(input, band, [&](std::size_t first, std::size_t count) HWY_ATTR {
    const RunCoordinates at(input, first, count);
    LookUp(input, at, count, &run);
    for (std::size_t p = 0; p < count; ++p) {
      const float* g = d_out.data() + (first + p) * n;
      FetchAhead(d_levels, n, run, p, count);
      if (!HasCotangent(g, n, end)) continue;
      for (int i = 0; i < 2 && run.taps[i].level[p] >= 0; ++i) {
        if (n > 4) {
          AddManyChannels(run.taps[i], p, g, end, sums);
        } else {
          cells[i].Add(run.taps[i], p, CotangentQuad(g, 0, n, end));
        }
      }
    }
  });
  for (CellSums& c : cells) c.Flush();
}

HWY_INLINE Quad Mixture(const TapQuads& q, const float (&weight)[4], Quad sum) {
  for (int k = 0; k < 4; ++k) sum = hn::MulAdd(hn::Set(QuadTag(), weight[k]), q.t[k], sum);
  return sum;
}

// Pixels first to first + count - 1, count at most kRun.
HWY_INLINE void SampleRun(const TextureInput<float>& input, const ImageLevels& levels,
                          std::size_t first, std::size_t count, std::span<float> out,
                          const float* end) {
  const RunCoordinates at(input, first, count);
  LookupRun run;
  LookUp(input, at, count, &run);
  const std::size_t n = levels.channels;
  const bool nearest = input.filter == TextureFilter::kNearest;
  for (std::size_t p = 0; p < count; ++p) {
    float* to = out.data() + (first + p) * n;
    FetchAhead(levels.at, n, run, p, count);
    for (std::size_t c = 0; c < n; c += 4) {
      const TapQuads fine(levels, run.taps[0], p, c);
      if (nearest) {
        StoreQuad(fine.t[0], to + c, end);
        continue;
      }
      Quad sum = Mixture(fine, run.taps[0].weight[p], hn::Zero(QuadTag()));
      if (run.taps[1].level[p] >= 0) {
        sum = Mixture(TapQuads(levels, run.taps[1], p, c), run.taps[1].weight[p], sum);
      }
      StoreQuad(sum, to + c, end);
    }
  }
}

void SampleBand(const TextureInput<float>& input, const Band& band, std::span<float> out) {
  const ImageLevels levels(input, band.image);
  const float* end = out.data() + input.grid.first(band.image, band.row_end) * input.channels;
  ForRuns(input, band, [&](std::size_t first, std::size_t count) HWY_ATTR {
    SampleRun(input, levels, first, count, out, end);
  });
}

// Gradients of pixels before sums over channels: by a and b of the levels, and by the mix.
struct alignas(128) PullRun {
  float a[2][kRun][4], b[2][kRun][4], mix[kRun][4];

  HWY_INLINE void Clear(std::size_t p) {
    for (auto* quads : {a[0], a[1], b[0], b[1], mix}) {
      hn::Store(hn::Zero(QuadTag()), QuadTag(), quads[p]);
    }
  }
};

HWY_INLINE void AddQuad(QuadMask counts, Quad g, Quad v, float* to) {
  const QuadTag d;
  hn::Store(hn::Add(hn::Load(d, to), hn::IfThenElseZero(counts, hn::Mul(g, v))), d, to);
}

// Channels c to c + 3 of pixel p at its i-th level: returns the sampled value.
HWY_INLINE Quad PullLevel(const ImageLevels& levels, const TapRun& taps, std::size_t p,
                          std::size_t c, Quad g, float* to_a, float* to_b) {
  const QuadTag d;
  const TapQuads q(levels, taps, p, c);
  const QuadMask counts = LanesBelow(c, levels.channels);
  const Quad a = hn::Set(d, taps.a[p]), b = hn::Set(d, taps.b[p]);
  const Quad low = hn::Sub(q.t[1], q.t[0]), high = hn::Sub(q.t[3], q.t[2]);
  const Quad bottom = hn::MulAdd(a, low, q.t[0]);
  const Quad along_b = hn::Sub(hn::MulAdd(a, high, q.t[2]), bottom);
  AddQuad(counts, g, hn::MulAdd(b, hn::Sub(high, low), low), to_a);
  AddQuad(counts, g, along_b, to_b);
  return hn::MulAdd(b, along_b, bottom);
}

HWY_INLINE void PullPixel(const ImageLevels& levels, const LookupRun& run, std::size_t p,
                          const float* d_out, const float* end, PullRun* pull) {
  const std::size_t n = levels.channels;
  pull->Clear(p);
  if (!HasCotangent(d_out, n, end)) return;
  for (std::size_t c = 0; c < n; c += 4) {
    const QuadMask counts = LanesBelow(c, n);
    const Quad g = LoadQuad(d_out + c, end);
    const Quad fine = PullLevel(levels, run.taps[0], p, c, g, pull->a[0][p], pull->b[0][p]);
    if (run.taps[1].level[p] < 0) continue;
    const Quad coarse = PullLevel(levels, run.taps[1], p, c, g, pull->a[1][p], pull->b[1][p]);
    AddQuad(counts, g, hn::Sub(coarse, fine), pull->mix[p]);
  }
}

HWY_INLINE RunVec SumQuads(const float (*quads)[4]) {
  RunVec a, b, c, e;
  hn::LoadInterleaved4(RunTag(), quads[0], a, b, c, e);
  return hn::Add(hn::Add(a, b), hn::Add(c, e));
}

// Cotangents of the coordinates of a vector of pixels.
struct CoordinateCotangents {
  RunVec uv[3], uv_da[6], level;
};

HWY_INLINE CoordinateCotangents PullCoordinates(const TextureInput<float>& input,
                                                const RunCoordinates& at, const LookupRun& run,
                                                const PullRun& pull, std::size_t i) {
  const RunTag d;
  const bool cube = input.boundary == TextureBoundary::kCube;
  const PointLanes point = FindPoints(input, at, i);
  CoordinateCotangents out;
  RunVec d_st[2], d_slopes[4];
  const RunVec mix = hn::Load(d, run.mix + i), rest = hn::Sub(hn::Set(d, 1.0f), mix);
  d_st[0] = hn::Mul(hn::Mul(rest, SumQuads(pull.a[0] + i)), hn::Load(d, run.taps[0].slope_a + i));
  d_st[1] = hn::Mul(hn::Mul(rest, SumQuads(pull.b[0] + i)), hn::Load(d, run.taps[0].slope_b + i));
  out.level = hn::Zero(d);
  for (RunVec& s : d_slopes) s = hn::Zero(d);
  const auto mixes = hn::RebindMask(
      d, hn::Gt(hn::Load(RunIntTag(), run.taps[1].level + i), hn::Set(RunIntTag(), -1)));
  if (!hn::AllFalse(d, mixes)) {
    const auto coarse = [&](const float(*quads)[4], const float* slope) HWY_ATTR {
      return hn::IfThenElseZero(mixes,
                                hn::Mul(hn::Mul(mix, SumQuads(quads + i)), hn::Load(d, slope + i)));
    };
    d_st[0] = hn::Add(d_st[0], coarse(pull.a[1], run.taps[1].slope_a));
    d_st[1] = hn::Add(d_st[1], coarse(pull.b[1], run.taps[1].slope_b));
    out.level = hn::IfThenElseZero(mixes, SumQuads(pull.mix + i));
    if (at.uv_da != nullptr) {
      LevelAdjointLanes(FootprintLanes(point.slopes, input.levels[0].size), out.level, d_slopes);
    }
  }
  if (cube) {
    CubeAdjointLanes(point, d_st, d_slopes, out.uv, out.uv_da);
  } else {
    std::copy(d_st, d_st + 2, out.uv);
    std::copy(d_slopes, d_slopes + 4, out.uv_da);
  }
  for (RunVec& v : out.uv) v = hn::IfThenElseZero(point.valid, v);
  for (RunVec& v : out.uv_da) v = hn::IfThenElseZero(point.valid, v);
  return out;
}

// Writes n numbers of each of the first `count` pixels of a vector.
HWY_INLINE void WriteNumbers(const RunVec* v, std::size_t n, std::size_t count, float* to) {
  const RunTag d;
  HWY_ALIGN float numbers[6][16];
  if (n == 1 && count == hn::Lanes(d)) return hn::StoreU(v[0], d, to);
  if (n == 2 && count == hn::Lanes(d)) return hn::StoreInterleaved2(v[0], v[1], d, to);
  if (n == 4 && count == hn::Lanes(d)) return hn::StoreInterleaved4(v[0], v[1], v[2], v[3], d, to);
  for (std::size_t k = 0; k < n; ++k) hn::Store(v[k], d, numbers[k]);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t k = 0; k < n; ++k) to[n * p + k] = numbers[k][p];
  }
}

// The gradients of coordinates; leaves those of levels alone.
void PullCoordinatesOfBand(const TextureInput<float>& input, const Band& band,
                           std::span<const float> d_out, const TextureGradients<float>& out) {
  const ImageLevels levels(input, band.image);
  const std::size_t n = input.coordinates(), lanes = hn::Lanes(RunTag());
  const float* d_end = d_out.data() + d_out.size();
  LookupRun run;
  PullRun pull;
  ForRuns(input, band, [&](std::size_t first, std::size_t count) HWY_ATTR {
    const RunCoordinates at(input, first, count);
    LookUp(input, at, count, &run);
    for (std::size_t p = 0; p < count; ++p) {
      FetchAhead(levels.at, levels.channels, run, p, count);
      PullPixel(levels, run, p, d_out.data() + (first + p) * input.channels, d_end, &pull);
    }
    for (std::size_t p = count; p % lanes != 0; ++p) pull.Clear(p);
    for (std::size_t i = 0; i < count; i += lanes) {
      const CoordinateCotangents d = PullCoordinates(input, at, run, pull, i);
      const std::size_t pixel = first + i, some = HWY_MIN(lanes, count - i);
      if (!out.d_uv.empty()) WriteNumbers(d.uv, n, some, &out.d_uv[n * pixel]);
      if (!out.d_uv_da.empty()) WriteNumbers(d.uv_da, 2 * n, some, &out.d_uv_da[2 * n * pixel]);
      if (!out.d_mip_level_bias.empty()) {
        WriteNumbers(&d.level, 1, some, &out.d_mip_level_bias[pixel]);
      }
    }
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// The gradient of texels.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TEXELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TEXELS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TEXELS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TEXELS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_quads-inl.h"
#include "compat/nvdiffrast/texture_taps-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Sums into the texels of an image's texture, of which a part belongs to this call: every parts-th
// block of kBlock texels of a level. Quads that would reach beyond a block are added number by
// number.
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
  // v on channels from `first` on; it is 0 beyond the last one.
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
  // Sums are kept finite; NaN stays.
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

// What the pixels at hand, which read the same texels, pull on four channels or fewer of each.
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

// Adds what the pixels of a band pull on the texels of `part`, in their order. d_levels: those of
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

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

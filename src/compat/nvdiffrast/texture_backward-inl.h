// SPDX-License-Identifier: Apache-2.0
// Vector body of texture.h, backward: from the texel addresses of a run of pixels the gradients of
// texels, with channels as lanes (quads-inl.h), and of coordinates, with pixels as lanes.

#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_taps-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {

// Whether a pixel's cotangent has a nonzero number. Mostly the background has none: it samples the
// texel at (0, 0) and is masked afterwards.
HWY_INLINE bool HasCotangent(const float* d_out, std::size_t n, const float* end) {
  for (std::size_t c = 0; c < n; c += 4) {
    const auto some = hn::Ne(LoadQuad(d_out + c, end), hn::Zero(kQuad));
    if (!hn::AllFalse(kQuad, hn::And(some, LanesBelow(c, n)))) return true;
  }
  return false;
}

// The gradient of texels.

// Sums into the texels of an image's texture, of which this call owns a part: every parts-th block
// of kBlock texels of a level. Quads that would reach beyond a block are added number by number.
class TexelSums {
 public:
  static constexpr std::uint32_t kBlock = 64;

  HWY_INLINE TexelSums(const TextureInput<float>& input, const TexelPart& part)
      : channels_(input.channels), part_(part) {
    for (std::size_t l = 0; l < input.levels.size() && part.levels != nullptr; ++l) {
      ends_[l] = part.levels[l] + TexelsOf(input.levels[l].size, input.faces()) * channels_;
    }
  }
  std::size_t channels() const { return channels_; }
  // Adds v to channels from `first` on; v is 0 beyond the last channel.
  HWY_INLINE void Add(std::size_t level, std::int32_t texel, std::size_t first, Quad v) const {
    const std::uint32_t block = static_cast<std::uint32_t>(texel) / kBlock;
    if (texel < 0 || (part_.parts > 1 && block % part_.parts != part_.part)) return;
    float* to = part_.levels[level] + static_cast<std::size_t>(texel) * channels_ + first;
    const float* of_block = part_.levels[level] + (std::size_t{block} + 1) * kBlock * channels_;
    if (HWY_UNLIKELY(HWY_MIN(of_block, ends_[level]) - to < 4)) {
      return AddSome(to, HWY_MIN(channels_ - first, std::size_t{4}), v);
    }
    AddTo(kQuad, v, to);
  }
  // The same for two texels of up to four channels. Of neighbours both are read before one is
  // written, and nothing is written beyond them: a load that overlaps a recent store in part waits
  // until that is in the cache.
  HWY_INLINE void AddPair(std::size_t level, const std::int32_t* texels, const Quad* v) const {
    const hn::Half<QuadTag> half;
    const std::int32_t texel = texels[0];
    const std::uint32_t block = static_cast<std::uint32_t>(texel) / kBlock;
    const bool own = part_.parts == 1 || block % part_.parts == part_.part;
    const std::int32_t in_block = texel % static_cast<std::int32_t>(kBlock);
    if (HWY_UNLIKELY(texel < 0 || texels[1] != texel + 1 ||
                     in_block == static_cast<std::int32_t>(kBlock) - 1 || !own)) {
      for (int k = 0; k < 2; ++k) Add(level, texels[k], 0, v[k]);
      return;
    }
    float* to = part_.levels[level] + static_cast<std::size_t>(texel) * channels_;
    switch (channels_) {
      case 1:
        return AddTo(half, hn::LowerHalf(half, hn::InterleaveLower(kQuad, v[0], v[1])), to);
      case 2:
        return AddTo(kQuad, hn::ConcatLowerLower(kQuad, v[1], v[0]), to);
      case 3: {
        const Quad first = hn::IfThenElse(hn::FirstN(kQuad, 3), v[0], hn::Broadcast<0>(v[1]));
        const auto rest = hn::LowerHalf(half, hn::ShiftRightLanes<1>(kQuad, v[1]));
        const Quad sum = hn::Add(hn::LoadU(kQuad, to), first);
        AddTo(half, rest, to + 4);
        return hn::StoreU(Finite(kQuad, sum), kQuad, to);
      }
      default:
        const Quad sum = hn::Add(hn::LoadU(kQuad, to), v[0]);
        AddTo(kQuad, v[1], to + 4);
        return hn::StoreU(Finite(kQuad, sum), kQuad, to);
    }
  }

 private:
  template <class D>
  static HWY_INLINE void AddTo(D d, hn::Vec<D> v, float* to) {
    hn::StoreU(Finite(d, hn::Add(hn::LoadU(d, to), v)), d, to);
  }
  // Clamps sums to finite values; NaN stays.
  template <class D>
  static HWY_INLINE hn::Vec<D> Finite(D d, hn::Vec<D> sum) {
    const auto most = hn::Set(d, std::numeric_limits<float>::max());
    const auto capped = hn::IfThenElse(hn::Gt(sum, most), most, sum);
    return hn::IfThenElse(hn::Lt(capped, hn::Neg(most)), hn::Neg(most), capped);
  }
  static HWY_NOINLINE void AddSome(float* to, std::size_t n, Quad v) {
    HWY_ALIGN float some[4] = {};
    std::copy(to, to + n, some);
    hn::Store(Finite(kQuad, hn::Add(hn::Load(kQuad, some), v)), kQuad, some);
    std::copy(some, some + n, to);
  }

  const float* ends_[kMostLevels];
  std::size_t channels_;
  TexelPart part_;
};

// Contributions of consecutive pixels that read the same texels, on up to four channels of each.
class CellSums {
 public:
  HWY_INLINE explicit CellSums(const TexelSums& to) : to_(to) {
    for (Quad& s : sum_) s = hn::Zero(kQuad);
  }

  HWY_INLINE void Add(const TapRun& taps, std::size_t p, Quad g) {
    const hn::RebindToSigned<QuadTag> di;
    const auto texel = hn::Load(di, taps.texel[p]);
    if (pixels_ == kMostRun || taps.level[p] != level_ ||
        !hn::AllTrue(di, hn::Eq(texel, hn::Load(di, texel_)))) {
      Flush();
      hn::Store(texel, di, texel_);
      level_ = taps.level[p];
    }
    ++pixels_;
    for (int k = 0; k < 4; ++k) sum_[k] = hn::MulAdd(hn::Set(kQuad, taps.weight[p][k]), g, sum_[k]);
  }
  HWY_INLINE void Flush() {
    if (level_ >= 0) {
      for (int mean = 0; mean < 4; ++mean) {
        if (HWY_LIKELY(texel_[mean] != Taps::kMean)) continue;
        const Quad third = hn::Mul(sum_[mean], hn::Set(kQuad, 1.0f / 3));
        for (Quad& s : sum_) s = hn::Add(s, third);
      }
      for (int k = 0; k < 4; k += 2) {
        to_.AddPair(static_cast<std::size_t>(level_), texel_ + k, sum_ + k);
      }
    }
    for (Quad& s : sum_) s = hn::Zero(kQuad);
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
    const Quad weight = hn::Set(kQuad, taps.weight[p][k] + mean);
    for (std::size_t c = 0; c < sums.channels(); c += 4) {
      sums.Add(static_cast<std::size_t>(taps.level[p]), texel[k], c,
               hn::Mul(weight, CotangentQuad(g, c, sums.channels(), end)));
    }
  }
}

// Adds pixel p of a run to the texels of its levels.
HWY_INLINE void PullTexels(const LookupRun& run, std::size_t p, const float* g, const float* end,
                           const TexelSums& sums, CellSums (&cells)[2]) {
  const std::size_t n = sums.channels();
  for (int i = 0; i < 2 && run.taps[i].level[p] >= 0; ++i) {
    if (n > 4) {
      AddManyChannels(run.taps[i], p, g, end, sums);
    } else {
      cells[i].Add(run.taps[i], p, CotangentQuad(g, 0, n, end));
    }
  }
}

// Gradients of pixels before sums over channels: by a and b of the levels, and by the mix.
struct alignas(128) PullRun {
  float a[2][kRun][4], b[2][kRun][4], mix[kRun][4];

  HWY_INLINE void Clear(std::size_t p) {
    for (auto* quads : {a[0], a[1], b[0], b[1], mix}) {
      hn::Store(hn::Zero(kQuad), kQuad, quads[p]);
    }
  }
};

// The gradients of one level, by a and b, and the sampled value.
struct LevelPull {
  Quad a, b, value;

  // Channels c to c + 3 of pixel p.
  HWY_INLINE LevelPull(const ImageLevels& levels, const TapRun& taps, std::size_t p, std::size_t c,
                       Quad g) {
    const TapQuads q = LoadTaps(levels, taps, p, c);
    const Quad at_a = hn::Set(kQuad, taps.a[p]), at_b = hn::Set(kQuad, taps.b[p]);
    const Quad low = hn::Sub(q.t[1], q.t[0]), high = hn::Sub(q.t[3], q.t[2]);
    const Quad bottom = hn::MulAdd(at_a, low, q.t[0]);
    const Quad along_b = hn::Sub(hn::MulAdd(at_a, high, q.t[2]), bottom);
    a = hn::Mul(g, hn::MulAdd(at_b, hn::Sub(high, low), low));
    b = hn::Mul(g, along_b);
    value = hn::MulAdd(at_b, along_b, bottom);
  }
};

HWY_INLINE void PullPixel(const ImageLevels& levels, const LookupRun& run, std::size_t p,
                          const float* d_out, const float* end, PullRun* pull) {
  const std::size_t n = levels.channels;
  const bool mixes = run.taps[1].level[p] >= 0;
  Quad a[2], b[2], mix = hn::Zero(kQuad);
  a[0] = a[1] = b[0] = b[1] = mix;
  for (std::size_t c = 0; c < n; c += 4) {
    const QuadMask counts = LanesBelow(c, n);
    const Quad g = LoadQuad(d_out + c, end);
    const auto add = [&](Quad v, Quad* sum)
                         HWY_ATTR { *sum = hn::Add(*sum, hn::IfThenElseZero(counts, v)); };
    const LevelPull fine(levels, run.taps[0], p, c, g);
    add(fine.a, &a[0]);
    add(fine.b, &b[0]);
    if (!mixes) continue;
    const LevelPull coarse(levels, run.taps[1], p, c, g);
    add(coarse.a, &a[1]);
    add(coarse.b, &b[1]);
    add(hn::Mul(g, hn::Sub(coarse.value, fine.value)), &mix);
  }
  for (int i = 0; i < 2; ++i) {
    hn::Store(a[i], kQuad, pull->a[i][p]);
    hn::Store(b[i], kQuad, pull->b[i][p]);
  }
  hn::Store(mix, kQuad, pull->mix[p]);
}

HWY_INLINE RunVec SumQuads(const float (*quads)[4]) {
  RunVec a, b, c, e;
  hn::LoadInterleaved4(kLanes, quads[0], a, b, c, e);
  return hn::Add(hn::Add(a, b), hn::Add(c, e));
}

// Cotangents of the coordinates of a vector of pixels.
struct CoordinateCotangents {
  RunVec uv[3], uv_da[6], level;
};

HWY_INLINE CoordinateCotangents PullCoordinates(const TextureInput<float>& input,
                                                const RunCoordinates& at, const LookupRun& run,
                                                const PullRun& pull, std::size_t i) {
  const bool cube = input.boundary == TextureBoundary::kCube;
  const PointLanes point = FindPoints(input, at, i);
  CoordinateCotangents out;
  RunVec d_st[2], d_slopes[4];
  const RunVec mix = hn::Load(kLanes, run.mix + i), rest = hn::Sub(hn::Set(kLanes, 1.0f), mix);
  d_st[0] =
      hn::Mul(hn::Mul(rest, SumQuads(pull.a[0] + i)), hn::Load(kLanes, run.taps[0].slope_a + i));
  d_st[1] =
      hn::Mul(hn::Mul(rest, SumQuads(pull.b[0] + i)), hn::Load(kLanes, run.taps[0].slope_b + i));
  out.level = hn::Zero(kLanes);
  for (RunVec& s : d_slopes) s = hn::Zero(kLanes);
  const auto mixes = hn::RebindMask(
      kLanes, hn::Gt(hn::Load(kIntLanes, run.taps[1].level + i), hn::Set(kIntLanes, -1)));
  if (!hn::AllFalse(kLanes, mixes)) {
    const auto coarse = [&](const float(*quads)[4], const float* slope) HWY_ATTR {
      return hn::IfThenElseZero(
          mixes, hn::Mul(hn::Mul(mix, SumQuads(quads + i)), hn::Load(kLanes, slope + i)));
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
  HWY_ALIGN float numbers[6][16];
  if (n == 1 && count == hn::Lanes(kLanes)) return hn::StoreU(v[0], kLanes, to);
  if (n == 2 && count == hn::Lanes(kLanes)) return hn::StoreInterleaved2(v[0], v[1], kLanes, to);
  if (n == 4 && count == hn::Lanes(kLanes))
    return hn::StoreInterleaved4(v[0], v[1], v[2], v[3], kLanes, to);
  for (std::size_t k = 0; k < n; ++k) hn::Store(v[k], kLanes, numbers[k]);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t k = 0; k < n; ++k) to[n * p + k] = numbers[k][p];
  }
}

HWY_INLINE void WriteCoordinates(const TextureInput<float>& input, const RunCoordinates& at,
                                 const LookupRun& run, const PullRun& pull,
                                 const TextureGradients<float>& out) {
  const std::size_t n = input.coordinates(), lanes = hn::Lanes(kLanes);
  for (std::size_t i = 0; i < at.count; i += lanes) {
    const CoordinateCotangents d = PullCoordinates(input, at, run, pull, i);
    const std::size_t pixel = at.first + i, some = HWY_MIN(lanes, at.count - i);
    if (!out.d_uv.empty()) WriteNumbers(d.uv, n, some, &out.d_uv[n * pixel]);
    if (!out.d_uv_da.empty()) WriteNumbers(d.uv_da, 2 * n, some, &out.d_uv_da[2 * n * pixel]);
    if (!out.d_mip_level_bias.empty()) {
      WriteNumbers(&d.level, 1, some, &out.d_mip_level_bias[pixel]);
    }
  }
}

// The gradients of a band: texels in pixel order, and coordinates where `out` has any.
void PullBand(const TextureInput<float>& input, const Band& band, std::span<const float> d_out,
              const TexelPart& part, const TextureGradients<float>& out) {
  const ImageLevels levels(input, band.image);
  const TexelSums sums(input, part);
  const std::size_t n = input.channels;
  const float* end = d_out.data() + d_out.size();
  const bool texels = part.levels != nullptr, coordinates = out.HasCoordinates();
  LookupRun run;
  PullRun pull;
  CellSums cells[2] = {CellSums(sums), CellSums(sums)};
  ForRuns(input, band, [&](std::size_t first, std::size_t count) HWY_ATTR {
    const RunCoordinates at(input, first, count);
    LookUp(input, at, &run);
    for (std::size_t p = 0; p < count; ++p) {
      const float* g = d_out.data() + (first + p) * n;
      if (texels) FetchAhead(part.levels, n, run, p, count);
      if (coordinates) FetchAhead(levels.at, n, run, p, count);
      if (!HasCotangent(g, n, end)) {
        if (coordinates) pull.Clear(p);
        continue;
      }
      if (texels) PullTexels(run, p, g, end, sums, cells);
      if (coordinates) PullPixel(levels, run, p, g, end, &pull);
    }
    if (!coordinates) return;
    for (std::size_t p = count; p % hn::Lanes(kLanes) != 0; ++p) pull.Clear(p);
    WriteCoordinates(input, at, run, pull, out);
  });
  for (CellSums& c : cells) c.Flush();
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

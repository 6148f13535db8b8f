// SPDX-License-Identifier: Apache-2.0
// Vector body of texture_taps.h: the texels that a run of pixels reads, and their weights. Lanes
// are pixels; float.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_point-inl.h"
#include "compat/nvdiffrast/texture_taps.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The texels that pixels read in one level, as Taps says, and their weights: of the level, and each
// with the level's share.
struct alignas(128) TapRun {
  std::int32_t texel[kRun][4];
  float weight[kRun][4];
  float a[kRun], b[kRun], slope_a[kRun], slope_b[kRun];
  std::int32_t level[kRun];  // negative: none
  // Negative if a tap is not a texel, or quads from it would reach beyond the level.
  std::int32_t whole[kRun];
};

struct LookupRun {
  TapRun taps[2];                // of the finer and the coarser level
  alignas(128) float mix[kRun];  // share of the coarser one
  bool mixes;                    // some pixel has one
};

inline bool UsesLevels(TextureFilter filter) {
  return filter == TextureFilter::kLinearMipmapNearest ||
         filter == TextureFilter::kLinearMipmapLinear;
}

// The levels of a vector of pixels: `fine`, and where `mixes` the next one takes `mix`.
struct LevelLanesOf {
  RunInt fine;
  RunVec mix;
  RunMask mixes;

  HWY_INLINE LevelLanesOf(const TextureInput<float>& input, const RunCoordinates& at, std::size_t i,
                          const PointLanes& point) {
    const RunTag d;
    const RunVec zero = hn::Zero(d);
    fine = hn::Zero(RunIntTag());
    mix = zero;
    mixes = hn::Lt(zero, zero);
    if (!UsesLevels(input.filter)) return;
    RunVec level = zero;
    if (at.uv_da != nullptr) level = LevelLanes(FootprintLanes(point.slopes, input.levels[0].size));
    if (at.bias != nullptr) level = hn::Add(level, hn::LoadU(d, at.bias + i));
    const RunVec last = hn::Set(d, static_cast<float>(input.levels.size() - 1));
    const RunMask above = hn::And(point.valid, hn::Gt(level, zero));
    const RunVec kept = hn::IfThenElseZero(above, hn::Min(level, last));
    fine = hn::ConvertTo(RunIntTag(), kept);  // towards zero: the floor
    if (input.filter == TextureFilter::kLinearMipmapNearest) return;
    mixes = hn::And(above, hn::Lt(level, last));
    mix = hn::IfThenElseZero(mixes, hn::Sub(kept, hn::Floor(kept)));
  }
};

// AxisTaps of texture_taps.cc; texels outside are -1 or n.
struct AxisLanes {
  RunInt low, high;
  RunVec weight, slope;

  HWY_INLINE AxisLanes(RunVec s, RunInt n, const TextureInput<float>& input) {
    const RunTag d;
    const RunIntTag di;
    const RunVec size = hn::ConvertTo(d, n), zero = hn::Zero(d);
    const RunInt last = hn::Sub(n, hn::Set(di, 1)), none = hn::Set(di, -1);
    if (input.boundary == TextureBoundary::kWrap) s = hn::Sub(s, hn::Floor(s));
    RunVec x = hn::Mul(s, size);
    weight = slope = zero;
    if (input.filter == TextureFilter::kNearest) {
      // Far away is outside, too, and fits into an integer.
      const RunVec cell = hn::Floor(hn::Min(hn::Max(x, hn::Set(d, -1.0f)), size));
      low = hn::Max(none, hn::Min(hn::ConvertTo(di, cell), n));
      if (input.boundary != TextureBoundary::kZero) low = hn::Max(hn::Zero(di), hn::Min(low, last));
      high = low;
      return;
    }
    x = hn::Sub(x, hn::Set(d, 0.5f));
    slope = size;
    RunMask inside = hn::And(hn::Gt(x, hn::Set(d, -1.0f)), hn::Lt(x, size));
    if (input.boundary == TextureBoundary::kClamp) {
      inside = hn::And(hn::Gt(x, zero), hn::Lt(x, hn::ConvertTo(d, last)));
      x = hn::Min(hn::Max(x, zero), hn::ConvertTo(d, last));
      slope = hn::IfThenElseZero(inside, slope);
    } else {
      x = hn::Min(hn::Max(x, hn::Set(d, -1.0f)), size);
    }
    const RunVec cell = hn::Floor(x);
    low = hn::Max(none, hn::Min(hn::ConvertTo(di, cell), last));
    high = hn::Add(low, hn::Set(di, 1));
    weight = hn::Sub(x, cell);
    SetBeyond(input.boundary, hn::RebindMask(di, inside), n);
  }

 private:
  HWY_INLINE void SetBeyond(TextureBoundary boundary, hn::Mask<RunIntTag> inside, RunInt n) {
    const RunIntTag di;
    const RunInt zero = hn::Zero(di), last = hn::Sub(n, hn::Set(di, 1));
    if (boundary == TextureBoundary::kWrap) {
      low = hn::IfThenElse(hn::Lt(low, zero), last, low);
      high = hn::IfThenElse(hn::Gt(high, last), zero, high);
    } else if (boundary == TextureBoundary::kClamp) {
      low = hn::Max(low, zero);
      high = hn::IfThenElse(inside, hn::Min(high, last), low);
      weight = hn::IfThenElseZero(hn::RebindMask(RunTag(), inside), weight);
    } else if (boundary == TextureBoundary::kZero) {
      low = hn::IfThenElse(inside, low, n);
      high = hn::IfThenElse(inside, high, n);
    }
  }
};

// The texel in column x and row y of a face, negative outside.
struct TexelLanes {
  RunInt width, height, face, first;
  bool outside;  // taps may be

  HWY_INLINE RunInt At(RunInt x, RunInt y) const {
    const RunIntTag di;
    const RunInt texel = hn::Add(hn::Add(first, hn::Mul(y, width)), x);
    if (!outside) return texel;
    const auto in = [&](RunInt v, RunInt n)
                        HWY_ATTR { return hn::And(hn::Gt(v, hn::Set(di, -1)), hn::Lt(v, n)); };
    return hn::IfThenElse(hn::And(in(x, width), in(y, height)), texel,
                          hn::Set(di, static_cast<std::int32_t>(Taps::kNothing)));
  }
};

// Texels over the edges of a cube's faces, one by one: where a vector of pixels from `i` on has
// any.
inline HWY_NOINLINE void CrossEdges(const MipSize& size, const AxisLanes& x, const AxisLanes& y,
                                    RunInt face, hn::Mask<RunIntTag> cross, std::size_t i,
                                    TapRun* out) {
  HWY_ALIGN std::int32_t columns[2][16], rows[2][16], faces[16];
  const RunIntTag di;
  face = hn::IfThenElse(cross, face, hn::Set(di, -1));
  hn::Store(x.low, di, columns[0]);
  hn::Store(x.high, di, columns[1]);
  hn::Store(y.low, di, rows[0]);
  hn::Store(y.high, di, rows[1]);
  hn::Store(face, di, faces);
  for (std::size_t p = 0; p < hn::Lanes(di); ++p) {
    if (faces[p] < 0) continue;
    const int side = HWY_MAX(1, size.width >> HWY_MAX(out->level[i + p], 0));
    for (int k = 0; k < 4; ++k) {
      out->texel[i + p][k] = static_cast<std::int32_t>(TexelAt(
          columns[k % 2][p], rows[k / 2][p], faces[p], {side, side}, TextureBoundary::kCube));
    }
  }
}

// Fills the taps of pixels i to i + lanes - 1 at `level`. Negative levels and pixels that are not
// valid have none.
HWY_INLINE void SetTaps(const TextureInput<float>& input, const PointLanes& point, RunInt level,
                        RunVec share, std::size_t i, TapRun* out) {
  const RunTag d;
  const RunIntTag di;
  const RunInt one = hn::Set(di, 1), none = hn::Set(di, static_cast<std::int32_t>(Taps::kNothing));
  const RunInt shift = hn::Max(level, hn::Zero(di));
  const MipSize& base = input.levels[0].size;
  TexelLanes texels;
  texels.width = hn::Max(hn::Shr(hn::Set(di, base.width), shift), one);
  texels.height = hn::Max(hn::Shr(hn::Set(di, base.height), shift), one);
  const RunInt of_face = hn::Mul(texels.width, texels.height);
  texels.first = hn::Mul(point.face, of_face);
  texels.outside =
      input.boundary == TextureBoundary::kZero || input.boundary == TextureBoundary::kCube;
  const AxisLanes x(point.st[0], texels.width, input), y(point.st[1], texels.height, input);
  RunInt at[4] = {texels.At(x.low, y.low), texels.At(x.high, y.low), texels.At(x.low, y.high),
                  texels.At(x.high, y.high)};
  const auto there = hn::And(hn::RebindMask(di, point.valid), hn::Gt(level, hn::Set(di, -1)));
  for (RunInt& t : at) t = hn::IfThenElse(there, t, none);
  // From the last texels on quads reach beyond the level.
  const auto n = static_cast<std::int32_t>(input.channels);
  const RunInt end = hn::Mul(of_face, hn::Set(di, static_cast<std::int32_t>(input.faces())));
  const RunInt most = hn::Sub(end, hn::Set(di, ((n + 3) / 4 * 4 + n - 1) / n));
  const RunInt reach = hn::Max(hn::Max(at[0], at[1]), hn::Max(at[2], at[3]));
  const RunInt least = hn::Or(hn::Or(at[0], at[1]), hn::Or(at[2], at[3]));
  hn::Store(hn::Or(least, hn::Sub(most, reach)), di, out->whole + i);
  hn::Store(level, di, out->level + i);
  hn::StoreInterleaved4(at[0], at[1], at[2], at[3], di, out->texel[i]);
  const RunVec b1 = hn::Mul(share, y.weight), b0 = hn::Sub(share, b1);
  const RunVec w1 = hn::Mul(x.weight, b0), w3 = hn::Mul(x.weight, b1);
  hn::StoreInterleaved4(hn::Sub(b0, w1), w1, hn::Sub(b1, w3), w3, d, out->weight[i]);
  hn::Store(x.weight, d, out->a + i);
  hn::Store(y.weight, d, out->b + i);
  hn::Store(x.slope, d, out->slope_a + i);
  hn::Store(y.slope, d, out->slope_b + i);
  const auto cross = hn::And(there, hn::Lt(least, hn::Zero(di)));
  if (input.boundary != TextureBoundary::kCube || hn::AllFalse(di, cross)) return;
  CrossEdges(base, x, y, point.face, cross, i, out);
}

// What `count` pixels read.
HWY_INLINE void LookUp(const TextureInput<float>& input, const RunCoordinates& at,
                       std::size_t count, LookupRun* out) {
  const RunTag d;
  out->mixes = false;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const PointLanes point = FindPoints(input, at, i);
    const LevelLanesOf levels(input, at, i, point);
    SetTaps(input, point, levels.fine, hn::Sub(hn::Set(d, 1.0f), levels.mix), i, &out->taps[0]);
    hn::Store(levels.mix, d, out->mix + i);
    const RunIntTag di;
    if (hn::AllFalse(d, levels.mixes)) {
      hn::Store(hn::Set(di, -1), di, out->taps[1].level + i);
      continue;
    }
    const RunInt coarse = hn::IfThenElse(hn::RebindMask(di, levels.mixes),
                                         hn::Add(levels.fine, hn::Set(di, 1)), hn::Set(di, -1));
    SetTaps(input, point, coarse, levels.mix, i, &out->taps[1]);
    out->mixes = true;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

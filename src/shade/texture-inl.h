// SPDX-License-Identifier: Apache-2.0
// Vector body of texture.h. Lanes are pixels.

#include <hwy/highway.h>

#include "shade/run_lanes-inl.h"
#include "shade/texture.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

using RunIntTag = hn::RebindToSigned<RunTag>;
inline constexpr RunIntTag kRunInt;
using RunInt = hn::Vec<RunIntTag>;
using TexelTag = hn::FixedTag<float, 4>;
using Texel = hn::Vec<TexelTag>;

// One axis of the filter for the pixels of a run: texels `low` and `high`, the weight of `high`,
// and its derivative. texture_ref.h has the scalar version.
struct alignas(128) AxisRun {
  std::int32_t low[kRunPixels], high[kRunPixels];
  float weight[kRunPixels], slope[kRunPixels];
};

struct WrappedLanes {
  RunVec at, slope;
};

HWY_INLINE WrappedLanes WrapLanes(RunVec u, Wrap wrap) {
  const auto zero = hn::Zero(kRun), one = hn::Set(kRun, 1.0f);
  // Beyond 2^23 a float has no fraction; clamped to that, the coordinate and its neighbours stay
  // integers.
  const auto finite = hn::Lt(hn::Abs(u), hn::Set(kRun, 0x1p126f));
  if (wrap == Wrap::kClamp) {
    const auto kept = hn::Min(hn::Max(u, hn::Set(kRun, -1.0f)), hn::Set(kRun, 2.0f));
    return {hn::IfThenElseZero(finite, kept),
            hn::IfThenElseZero(hn::And(finite, hn::Eq(kept, u)), one)};
  }
  if (wrap != Wrap::kMirror) {
    return {hn::IfThenElseZero(finite, hn::Sub(u, hn::Floor(u))), hn::IfThenElseZero(finite, one)};
  }
  const auto half = hn::Floor(hn::Mul(u, hn::Set(kRun, 0.5f)));
  const auto two = hn::IfThenElse(finite, hn::Sub(u, hn::Add(half, half)), zero);
  const auto back = hn::Gt(two, one);
  return {hn::IfThenElse(back, hn::Sub(hn::Set(kRun, 2.0f), two), two),
          hn::IfThenElseZero(finite, hn::IfThenElse(back, hn::Set(kRun, -1.0f), one))};
}

HWY_INLINE RunInt ClampIndex(RunInt i, RunInt most) {
  return hn::Min(hn::Max(i, hn::Zero(kRunInt)), most);
}

// `most`: the last index.
HWY_INLINE RunInt WrapLaneIndex(RunInt i, RunInt most, Wrap wrap) {
  if (wrap != Wrap::kRepeat) return ClampIndex(i, most);
  const auto zero = hn::Zero(kRunInt);
  return hn::IfThenElse(hn::Lt(i, zero), most, hn::IfThenElse(hn::Gt(i, most), zero, i));
}

// `u`: wrapped with mode `way`; `n`: texels of the axis, at the level of each pixel.
HWY_INLINE void SetAxis(const WrappedLanes& u, RunInt n, Wrap way, const TextureInput& input,
                        std::size_t i, AxisRun* out) {
  const bool nearest = input.filter == Filter::kNearest;
  const auto most = hn::Sub(n, hn::Set(kRunInt, 1));
  const auto scale = hn::ConvertTo(kRun, n);
  auto x = hn::Mul(u.at, scale);
  if (!nearest) x = hn::Sub(x, hn::Set(kRun, 0.5f));
  const auto cell = hn::Floor(x);
  const auto low = hn::ConvertTo(kRunInt, cell);
  if (nearest) {
    const auto index = ClampIndex(low, most);
    hn::Store(index, kRunInt, out->low + i);
    hn::Store(index, kRunInt, out->high + i);
    hn::Store(hn::Zero(kRun), kRun, out->weight + i);
    hn::Store(hn::Zero(kRun), kRun, out->slope + i);
    return;
  }
  hn::Store(WrapLaneIndex(low, most, way), kRunInt, out->low + i);
  const auto high = hn::Add(low, hn::Set(kRunInt, 1));
  hn::Store(WrapLaneIndex(high, most, way), kRunInt, out->high + i);
  hn::Store(hn::Sub(x, cell), kRun, out->weight + i);
  hn::Store(hn::Mul(u.slope, scale), kRun, out->slope + i);
}

// The footprint of a run at one level per pixel.
struct FootprintRun {
  AxisRun column, row;
};

// Texels along an axis that has `n` at the finest level, at the levels of a vector of pixels:
// halved and rounded down, at least 1.
HWY_INLINE RunInt SizeAt(int n, RunInt level) {
  return hn::Max(hn::Shr(hn::Set(kRunInt, n), level), hn::Set(kRunInt, 1));
}

// `levels`: of the pixels of the run.
HWY_INLINE void SetFootprints(std::size_t count, const TextureInput& input,
                              const std::int32_t* levels, FootprintRun* out) {
  const Wrap across = WrapAlongU(input.wrap), down = WrapAlongV(input.wrap);
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const auto level = hn::Load(kRunInt, levels + i);
    const WrappedLanes u = WrapLanes(LoadRun(input.uv[0], i), across);
    SetAxis(u, SizeAt(input.levels[0].width, level), across, input, i, &out->column);
    WrappedLanes v = WrapLanes(LoadRun(input.uv[1], i), down);
    v = {hn::Sub(hn::Set(kRun, 1.0f), v.at), hn::Neg(v.slope)};
    SetAxis(v, SizeAt(input.levels[0].height, level), down, input, i, &out->row);
  }
}

// The four texels of a pixel.
struct TexelQuad {
  Texel t[4];

  HWY_INLINE TexelQuad(const FootprintRun& at, const TextureLevel& level, std::size_t p) {
    const TexelTag d;
    const std::int32_t columns[2] = {at.column.low[p], at.column.high[p]};
    const std::int32_t rows[2] = {at.row.low[p], at.row.high[p]};
    for (int k = 0; k < 4; ++k) {
      const auto texel =
          static_cast<std::size_t>(rows[k / 2]) * static_cast<std::size_t>(level.width) +
          static_cast<std::size_t>(columns[k % 2]);
      t[k] = hn::Load(d, level.texels + 4 * texel);
    }
  }
  HWY_INLINE Texel Bilinear(float a, float b) const {
    const TexelTag d;
    const auto wa = hn::Set(d, a), wb = hn::Set(d, b);
    const auto top = hn::MulAdd(wa, hn::Sub(t[1], t[0]), t[0]);
    const auto bottom = hn::MulAdd(wa, hn::Sub(t[3], t[2]), t[2]);
    return hn::MulAdd(wb, hn::Sub(bottom, top), top);
  }
};

// The levels between which the pixels of a run interpolate, and the weight of the coarser one:
// MixLevels of texture_levels_ref.h.
struct alignas(128) MixRun {
  std::int32_t fine[kRunPixels], coarse[kRunPixels];
  float share[kRunPixels];
};

HWY_INLINE void MixLevelsRun(std::size_t count, const TextureInput& input, MixRun* out) {
  const bool trilinear = input.filter == Filter::kTrilinear;
  const auto last = hn::Set(kRunInt, static_cast<std::int32_t>(input.levels.size()) - 1);
  const auto most = hn::ConvertTo(kRun, last);
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const auto level = trilinear ? LoadRun(*input.level, i) : hn::Zero(kRun);
    const auto kept = hn::IfThenElseZero(hn::Gt(level, hn::Zero(kRun)), hn::Min(level, most));
    const auto fine = hn::ConvertTo(kRunInt, hn::Floor(kept));
    hn::Store(fine, kRunInt, out->fine + i);
    hn::Store(hn::Min(hn::Add(fine, hn::Set(kRunInt, 1)), last), kRunInt, out->coarse + i);
    hn::Store(hn::Sub(kept, hn::Floor(kept)), kRun, out->share + i);
  }
}

// The bilinear value of pixel p at the level of its footprint.
HWY_INLINE Texel SampleAt(const TextureInput& input, const FootprintRun& at, std::int32_t level,
                          std::size_t p) {
  const TexelQuad texels(at, input.levels[static_cast<std::size_t>(level)], p);
  return texels.Bilinear(at.column.weight[p], at.row.weight[p]);
}

// [pixel][4] to planes.
HWY_INLINE void StorePlanes(const float* quads, std::size_t count, RunPlane* color) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    RunVec r, g, b, rest;
    hn::LoadInterleaved4(kRun, quads + 4 * i, r, g, b, rest);
    StoreRun3({r, g, b}, color, i);
  }
}

HWY_INLINE std::size_t WholeVectors(std::size_t count) {
  const std::size_t lanes = hn::Lanes(kRun);
  return (count + lanes - 1) / lanes * lanes;
}

void SampleRun(std::size_t count, const TextureInput& input, RunPlane* color) {
  const TexelTag d;
  FootprintRun at;
  MixRun mix;
  HWY_ALIGN float quads[4 * kRunPixels];
  const std::size_t whole = WholeVectors(count);
  MixLevelsRun(count, input, &mix);
  SetFootprints(count, input, mix.fine, &at);
  for (std::size_t p = 0; p < whole; ++p) {
    hn::Store(SampleAt(input, at, mix.fine[p], p), d, quads + 4 * p);
  }
  if (input.filter == Filter::kTrilinear) {
    SetFootprints(count, input, mix.coarse, &at);
    for (std::size_t p = 0; p < whole; ++p) {
      if (mix.share[p] == 0) continue;
      const auto fine = hn::Load(d, quads + 4 * p);
      const auto change = hn::Sub(SampleAt(input, at, mix.coarse[p], p), fine);
      hn::Store(hn::MulAdd(hn::Set(d, mix.share[p]), change, fine), d, quads + 4 * p);
    }
  }
  StorePlanes(quads, count, color);
}

// Gradients by the weights of a run's footprints, [pixel][4] each.
struct alignas(128) WeightPull {
  float a[4 * kRunPixels], b[4 * kRunPixels];
};

// Adds the gradient of pixel p at one level, times its slopes, to `pull`.
HWY_INLINE void PullPixel(const FootprintRun& at, const TextureLevel& level, Texel d_color,
                          std::size_t p, WeightPull* pull) {
  const TexelTag d;
  const TexelQuad q(at, level, p);
  const auto a = hn::Set(d, at.column.weight[p]), b = hn::Set(d, at.row.weight[p]);
  const auto top = hn::Sub(q.t[1], q.t[0]), bottom = hn::Sub(q.t[3], q.t[2]);
  const auto left = hn::Sub(q.t[2], q.t[0]), right = hn::Sub(q.t[3], q.t[1]);
  const auto along_a = hn::MulAdd(b, hn::Sub(bottom, top), top);
  const auto along_b = hn::MulAdd(a, hn::Sub(right, left), left);
  float *to_a = pull->a + 4 * p, *to_b = pull->b + 4 * p;
  const auto slope_a = hn::Mul(d_color, hn::Set(d, at.column.slope[p]));
  const auto slope_b = hn::Mul(d_color, hn::Set(d, at.row.slope[p]));
  hn::Store(hn::MulAdd(slope_a, along_a, hn::Load(d, to_a)), d, to_a);
  hn::Store(hn::MulAdd(slope_b, along_b, hn::Load(d, to_b)), d, to_b);
}

HWY_INLINE TexelShare MakeShare(const FootprintRun& at, std::size_t level, const RunPlane* d_color,
                                float scale, std::size_t p) {
  TexelShare out;
  out.x0 = static_cast<std::uint16_t>(at.column.low[p]);
  out.x1 = static_cast<std::uint16_t>(at.column.high[p]);
  out.y0 = static_cast<std::uint16_t>(at.row.low[p]);
  out.y1 = static_cast<std::uint16_t>(at.row.high[p]);
  out.a = at.column.weight[p];
  out.b = at.row.weight[p];
  for (std::size_t c = 0; c < 3; ++c) out.d_color[c] = scale * d_color[c].at[p];
  out.level = static_cast<std::uint32_t>(level);
  return out;
}

// The gradients of a run, before sums over channels. Either may be null.
struct PullTo {
  WeightPull* weights;
  TexelShare* shares;
};

// The pixels of a run at one of their levels. scale: of all pixels, or null: 1. Shares are `step`
// apart.
struct PullLevels {
  const std::int32_t* level;
  const float* scale;
  std::size_t step;
};

HWY_INLINE void PullRun(std::size_t count, const TextureInput& input, const RunPlane* d_color,
                        const PullLevels& levels, const PullTo& to) {
  const TexelTag d;
  FootprintRun at;
  SetFootprints(count, input, levels.level, &at);
  for (std::size_t p = 0; p < count; ++p) {
    const float scale = levels.scale == nullptr ? 1.0f : levels.scale[p];
    const auto level = static_cast<std::size_t>(levels.level[p]);
    if (to.shares != nullptr) {
      to.shares[levels.step * p] = MakeShare(at, level, d_color, scale, p);
    }
    if (to.weights == nullptr) continue;
    HWY_ALIGN const float pull[4] = {scale * d_color[0].at[p], scale * d_color[1].at[p],
                                     scale * d_color[2].at[p], 0};
    PullPixel(at, input.levels[level], hn::Load(d, pull), p, to.weights);
  }
}

HWY_INLINE void PullMixed(std::size_t count, const TextureInput& input, const RunPlane* d_color,
                          const PullTo& to) {
  MixRun mix;
  MixLevelsRun(count, input, &mix);
  if (input.filter != Filter::kTrilinear) {
    PullRun(count, input, d_color, {mix.fine, nullptr, 1}, to);
    return;
  }
  RunPlane rest;
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    StoreRun(hn::Sub(hn::Set(kRun, 1.0f), hn::Load(kRun, mix.share + i)), &rest, i);
  }
  PullRun(count, input, d_color, {mix.fine, rest.at, 2}, to);
  PullRun(count, input, d_color, {mix.coarse, mix.share, 2},
          {to.weights, to.shares == nullptr ? nullptr : to.shares + 1});
}

HWY_INLINE void SumWeightPull(std::size_t count, const WeightPull& pull, RunPlane* d_uv) {
  const float* const from[2] = {pull.a, pull.b};
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
      RunVec r, g, b, rest;
      hn::LoadInterleaved4(kRun, from[k] + 4 * i, r, g, b, rest);
      StoreRun(hn::Add(r, hn::Add(g, b)), &d_uv[k], i);
    }
  }
}

void SampleRunAdjoint(std::size_t count, const TextureInput& input, const RunPlane* d_color,
                      RunPlane* d_uv, TexelShare* shares) {
  WeightPull pull;
  if (d_uv != nullptr) {
    for (std::size_t i = 0; i < 4 * WholeVectors(count); i += hn::Lanes(kRun)) {
      hn::Store(hn::Zero(kRun), kRun, pull.a + i);
      hn::Store(hn::Zero(kRun), kRun, pull.b + i);
    }
  }
  PullMixed(count, input, d_color, {d_uv == nullptr ? nullptr : &pull, shares});
  if (d_uv != nullptr) SumWeightPull(count, pull, d_uv);
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

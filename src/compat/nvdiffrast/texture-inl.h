// SPDX-License-Identifier: Apache-2.0
// Vector body of texture.h: where pixels read is found for runs of them, lanes are pixels
// (texture_point-inl.h, texture_taps-inl.h); what they read are quads, lanes are channels
// (texture_quads-inl.h).
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
#include <span>

#include "compat/nvdiffrast/quads-inl.h"
#include "compat/nvdiffrast/texture.h"
#include "compat/nvdiffrast/texture_quads-inl.h"
#include "compat/nvdiffrast/texture_taps-inl.h"
#include "compat/nvdiffrast/texture_texels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

// What pixels pull, before sums over channels: on a and b of the levels, and on the mixture.
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

// Channels c to c + 3 of pixel p at its i-th level: the value of which is returned.
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

// The gradients of coordinates; those of levels are left alone.
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

// SPDX-License-Identifier: Apache-2.0
// Vector body of texture_taps.h: the texels that a run of pixels reads, and their weights. Lanes
// are pixels; float.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_TAPS_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <span>

#include "compat/nvdiffrast/texture_taps.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Vector body of texture_taps.h: the texture points that pixels look up, their footprints and
// levels, and the adjoints. Lanes are pixels of a run; float.

using RunTag = HWY_CAPPED(float, 16);
using RunIntTag = hn::RebindToSigned<RunTag>;
inline constexpr RunTag kLanes;
inline constexpr RunIntTag kIntLanes;
using RunVec = hn::Vec<RunTag>;
using RunInt = hn::Vec<RunIntTag>;
using RunMask = hn::Mask<RunTag>;
inline constexpr std::size_t kRun = 128;  // pixels: their data stays in the L1 cache

// Coordinates of a run: those of the images, or a padded copy at their end.
struct RunCoordinates {
  std::size_t first, count;  // pixels
  const float *uv, *uv_da = nullptr, *bias = nullptr;
  alignas(128) float padded[kRun * 10];

  HWY_INLINE RunCoordinates(const TextureInput<float>& input, std::size_t first_pixel,
                            std::size_t pixels)
      : first(first_pixel), count(pixels) {
    const std::size_t n = input.coordinates();
    float* free = padded;
    const auto place = [&](std::span<const float> from, std::size_t numbers) -> const float* {
      if (from.empty()) return nullptr;
      const float* at = from.data() + first * numbers;
      if (count % hn::Lanes(kLanes) == 0) return at;
      std::memset(free, 0, kRun * numbers * sizeof(float));
      std::memcpy(free, at, count * numbers * sizeof(float));
      at = free;
      free += kRun * numbers;
      return at;
    };
    uv = place(input.uv, n);
    uv_da = place(input.uv_da, 2 * n);
    bias = place(input.mip_level_bias, 1);
  }
};

// TexturePoint of texture_taps.h. For cube maps also the direction along the axes of its face: p
// and q are s and t in [-1, 1].
struct PointLanes {
  RunVec st[2], slopes[4];
  RunMask valid;
  RunInt face;
  RunMask axis[3];
  RunVec sign, major, ratio[2];  // of the largest component; its length; p, q
  RunVec d_major[2];             // by X and Y
};

HWY_INLINE RunMask FiniteLanes(RunVec v) { return hn::Eq(hn::Sub(v, v), hn::Zero(kLanes)); }

// A vector (x, y, z) in the axes of faces: kCubeFaces of texture_cube.h.
struct FaceFrame {
  RunVec s, t, major;

  HWY_INLINE FaceFrame(const PointLanes& p, RunVec x, RunVec y, RunVec z) {
    const RunVec sx = hn::Mul(p.sign, x), sy = hn::Mul(p.sign, y), sz = hn::Mul(p.sign, z);
    s = hn::IfThenElse(p.axis[0], hn::Neg(sz), hn::IfThenElse(p.axis[1], x, sx));
    t = hn::IfThenElse(p.axis[1], sz, hn::Neg(y));
    major = hn::IfThenElse(p.axis[0], sx, hn::IfThenElse(p.axis[1], sy, sz));
  }
};
// The inverse.
struct FromFaceFrame {
  RunVec xyz[3];

  HWY_INLINE FromFaceFrame(const PointLanes& p, RunVec s, RunVec t, RunVec major) {
    const RunVec ss = hn::Mul(p.sign, s), st = hn::Mul(p.sign, t), sm = hn::Mul(p.sign, major);
    xyz[0] = hn::IfThenElse(p.axis[0], sm, hn::IfThenElse(p.axis[1], s, ss));
    xyz[1] = hn::IfThenElse(p.axis[1], sm, hn::Neg(t));
    xyz[2] = hn::IfThenElse(p.axis[0], hn::Neg(ss), hn::IfThenElse(p.axis[1], st, sm));
  }
};

HWY_INLINE void FindPlainPoints(const RunCoordinates& at, std::size_t i, PointLanes* out) {
  hn::LoadInterleaved2(kLanes, at.uv + 2 * i, out->st[0], out->st[1]);
  out->valid = hn::And(FiniteLanes(out->st[0]), FiniteLanes(out->st[1]));
  out->face = hn::Zero(kIntLanes);
  if (at.uv_da == nullptr) return;
  hn::LoadInterleaved4(kLanes, at.uv_da + 4 * i, out->slopes[0], out->slopes[1], out->slopes[2],
                       out->slopes[3]);
}

HWY_INLINE void FindAxes(const RunVec (&r)[3], PointLanes* out) {
  const RunVec x = hn::Abs(r[0]), y = hn::Abs(r[1]), z = hn::Abs(r[2]);
  out->axis[2] = hn::Gt(z, hn::Max(x, y));
  out->axis[1] = hn::AndNot(out->axis[2], hn::Gt(y, x));
  out->axis[0] = hn::Not(hn::Or(out->axis[1], out->axis[2]));
  const RunVec largest =
      hn::IfThenElse(out->axis[0], r[0], hn::IfThenElse(out->axis[1], r[1], r[2]));
  const RunMask negative = hn::Lt(largest, hn::Zero(kLanes));
  out->valid =
      hn::And(hn::Ne(largest, hn::Zero(kLanes)), FiniteLanes(hn::Add(r[0], hn::Add(r[1], r[2]))));
  out->sign = hn::IfThenElse(negative, hn::Set(kLanes, -1.0f), hn::Set(kLanes, 1.0f));
  const auto number = [&](const RunMask& mask, std::int32_t v) HWY_ATTR {
    return hn::IfThenElseZero(hn::RebindMask(kIntLanes, mask), hn::Set(kIntLanes, v));
  };
  out->face =
      hn::Add(number(negative, 1), hn::Add(number(out->axis[1], 2), number(out->axis[2], 4)));
}

HWY_INLINE void FindCubePoints(const RunCoordinates& at, std::size_t i, PointLanes* out) {
  RunVec r[3];
  hn::LoadInterleaved3(kLanes, at.uv + 3 * i, r[0], r[1], r[2]);
  FindAxes(r, out);
  const FaceFrame frame(*out, r[0], r[1], r[2]);
  const RunVec half = hn::Set(kLanes, 0.5f);
  out->major = frame.major;
  out->ratio[0] = hn::Div(frame.s, frame.major);
  out->ratio[1] = hn::Div(frame.t, frame.major);
  for (int k = 0; k < 2; ++k) out->st[k] = hn::MulAdd(half, out->ratio[k], half);
  if (at.uv_da == nullptr) return;
  RunVec x[2], y[2], z[2];
  HWY_ALIGN float planes[6][16];
  for (std::size_t p = 0; p < hn::Lanes(kLanes); ++p) {
    for (std::size_t k = 0; k < 6; ++k) planes[k][p] = at.uv_da[6 * (i + p) + k];
  }
  for (int k = 0; k < 2; ++k) {
    x[k] = hn::Load(kLanes, planes[k]);
    y[k] = hn::Load(kLanes, planes[2 + k]);
    z[k] = hn::Load(kLanes, planes[4 + k]);
    const FaceFrame by(*out, x[k], y[k], z[k]);
    const RunVec scale = hn::Div(half, frame.major);
    out->d_major[k] = by.major;
    out->slopes[k] = hn::Mul(hn::NegMulAdd(out->ratio[0], by.major, by.s), scale);
    out->slopes[2 + k] = hn::Mul(hn::NegMulAdd(out->ratio[1], by.major, by.t), scale);
  }
}

HWY_INLINE PointLanes FindPoints(const TextureInput<float>& input, const RunCoordinates& at,
                                 std::size_t i) {
  PointLanes out;
  // Adjoints multiply both by 0 if there are no derivatives: garbage could be NaN.
  for (RunVec& s : out.slopes) s = hn::Zero(kLanes);
  for (RunVec& m : out.d_major) m = hn::Zero(kLanes);
  if (input.boundary == TextureBoundary::kCube) {
    FindCubePoints(at, i, &out);
  } else {
    FindPlainPoints(at, i, &out);
  }
  for (RunVec& s : out.st) s = hn::IfThenElseZero(out.valid, s);  // then weights are not NaN
  return out;
}

// 2^e for e in [-126, 127].
HWY_INLINE RunVec PowerOfTwo(RunInt e) {
  return hn::BitCast(kLanes, hn::ShiftLeft<23>(hn::Add(e, hn::Set(kIntLanes, 127))));
}

// Footprint of texture_taps.cc: J times 2^-exponent, so that no square overflows. Powers of two
// keep their digits.
struct FootprintLanes {
  RunInt exponent;
  RunVec scale[2], j[4];
  RunVec half, c, root, square;

  HWY_INLINE FootprintLanes(const RunVec (&slopes)[4], const MipSize& size) {
    RunVec largest = hn::Zero(kLanes);
    for (int i = 0; i < 4; ++i) {
      j[i] =
          hn::Mul(slopes[i], hn::Set(kLanes, static_cast<float>(i < 2 ? size.width : size.height)));
      largest = hn::Max(largest, hn::Abs(j[i]));
    }
    exponent =
        hn::Sub(hn::ShiftRight<23>(hn::BitCast(kIntLanes, largest)), hn::Set(kIntLanes, 127));
    exponent = hn::Max(hn::Min(exponent, hn::Set(kIntLanes, 126)), hn::Set(kIntLanes, -126));
    const RunVec down = PowerOfTwo(hn::Neg(exponent));
    scale[0] = hn::Mul(down, hn::Set(kLanes, static_cast<float>(size.width)));
    scale[1] = hn::Mul(down, hn::Set(kLanes, static_cast<float>(size.height)));
    for (RunVec& v : j) v = hn::Mul(v, down);
    const RunVec a = hn::MulAdd(j[0], j[0], hn::Mul(j[2], j[2]));
    const RunVec b = hn::MulAdd(j[1], j[1], hn::Mul(j[3], j[3]));
    const RunVec one_half = hn::Set(kLanes, 0.5f);
    half = hn::Mul(one_half, hn::Sub(a, b));
    c = hn::MulAdd(j[0], j[1], hn::Mul(j[2], j[3]));
    root = hn::Sqrt(hn::MulAdd(half, half, hn::Mul(c, c)));
    square = hn::MulAdd(one_half, hn::Add(a, b), root);
  }
};

// For x > 0; exact if x is a power of two.
HWY_INLINE RunVec Log2Lanes(RunVec x) {
  // x = 2^e m, m in [sqrt(1/2), sqrt(2)).
  const RunInt bits = hn::BitCast(kIntLanes, x);
  const RunInt e =
      hn::Sub(hn::ShiftRight<23>(hn::Add(bits, hn::Set(kIntLanes, 0x3f800000 - 0x3f3504f3))),
              hn::Set(kIntLanes, 127));
  const RunVec m = hn::BitCast(kLanes, hn::Sub(bits, hn::ShiftLeft<23>(e)));
  return hn::MulAdd(hn::Log(kLanes, m), hn::Set(kLanes, std::numbers::log2e_v<float>),
                    hn::ConvertTo(kLanes, e));
}

// LevelOf of texture_taps.h.
HWY_INLINE RunVec LevelLanes(const FootprintLanes& f) {
  const RunVec level =
      hn::MulAdd(hn::Set(kLanes, 0.5f), Log2Lanes(f.square), hn::ConvertTo(kLanes, f.exponent));
  return hn::IfThenElse(hn::Gt(f.square, hn::Zero(kLanes)), level,
                        hn::Set(kLanes, -std::numeric_limits<float>::infinity()));
}

// LevelAdjoint of texture_taps.h.
HWY_INLINE void LevelAdjointLanes(const FootprintLanes& f, RunVec d_level, RunVec (&d_slopes)[4]) {
  const RunVec zero = hn::Zero(kLanes), half = hn::Set(kLanes, 0.5f), two = hn::Set(kLanes, 2.0f);
  const RunMask oval = hn::Gt(f.root, zero), some = hn::Gt(f.square, zero);
  const RunVec cosine = hn::IfThenElseZero(oval, hn::Div(f.half, f.root));
  const RunVec sine = hn::IfThenElseZero(oval, hn::Div(f.c, f.root));
  const RunVec d_square = hn::IfThenElseZero(
      hn::And(some, hn::Ne(d_level, zero)),
      hn::Div(hn::Mul(d_level, hn::Set(kLanes, 0.5f / std::numbers::ln2_v<float>)), f.square));
  const RunVec d_a = hn::Mul(half, hn::MulAdd(cosine, d_square, d_square));
  const RunVec d_b = hn::Mul(half, hn::NegMulAdd(cosine, d_square, d_square));
  const RunVec d_c = hn::Mul(sine, d_square);
  for (int i = 0; i < 4; i += 2) {
    const RunVec x = hn::MulAdd(hn::Mul(two, f.j[i]), d_a, hn::Mul(f.j[i + 1], d_c));
    const RunVec y = hn::MulAdd(hn::Mul(two, f.j[i + 1]), d_b, hn::Mul(f.j[i], d_c));
    d_slopes[i] = hn::Mul(x, f.scale[i / 2]);
    d_slopes[i + 1] = hn::Mul(y, f.scale[i / 2]);
  }
}

// PointAdjoint of texture_taps.h for a cube map: d_uv [3], d_uv_da [6].
HWY_INLINE void CubeAdjointLanes(const PointLanes& p, const RunVec (&d_st)[2],
                                 const RunVec (&d_slopes)[4], RunVec (&d_uv)[3],
                                 RunVec (&d_uv_da)[6]) {
  const RunVec half = hn::Set(kLanes, 0.5f), inverse = hn::Div(hn::Set(kLanes, 1.0f), p.major);
  RunVec axis[2], d_major = hn::Zero(kLanes), by_axis[2][2],
                  by_major[2] = {hn::Zero(kLanes), hn::Zero(kLanes)};
  for (int k = 0; k < 2; ++k) {
    RunVec d_p = hn::Mul(half, d_st[k]);
    for (int i = 0; i < 2; ++i) {
      const RunVec g = hn::Mul(d_slopes[2 * k + i], hn::Mul(half, inverse));
      by_axis[k][i] = g;
      by_major[i] = hn::NegMulAdd(g, p.ratio[k], by_major[i]);
      d_p = hn::NegMulAdd(g, p.d_major[i], d_p);
      d_major = hn::NegMulAdd(hn::Add(g, g), p.slopes[2 * k + i], d_major);
    }
    axis[k] = hn::Mul(d_p, inverse);
    d_major = hn::NegMulAdd(axis[k], p.ratio[k], d_major);
  }
  const FromFaceFrame uv(p, axis[0], axis[1], d_major);
  for (int c = 0; c < 3; ++c) d_uv[c] = uv.xyz[c];
  for (int i = 0; i < 2; ++i) {
    const FromFaceFrame by(p, by_axis[0][i], by_axis[1][i], by_major[i]);
    for (int c = 0; c < 3; ++c) d_uv_da[2 * c + i] = by.xyz[c];
  }
}

// The texels that pixels read in one level, as in Taps, and their weights: in the level, and each
// times the level's share.
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
  bool mixes;                    // for some pixel
};

inline bool UsesLevels(TextureFilter filter) {
  return filter == TextureFilter::kLinearMipmapNearest ||
         filter == TextureFilter::kLinearMipmapLinear;
}

// The levels of a vector of pixels: `fine`, and where `mixes` the next one with weight `mix`.
struct LevelLanesOf {
  RunInt fine;
  RunVec mix;
  RunMask mixes;

  HWY_INLINE LevelLanesOf(const TextureInput<float>& input, const RunCoordinates& at, std::size_t i,
                          const PointLanes& point) {
    const RunVec zero = hn::Zero(kLanes);
    fine = hn::Zero(kIntLanes);
    mix = zero;
    mixes = hn::Lt(zero, zero);
    if (!UsesLevels(input.filter)) return;
    RunVec level = zero;
    if (at.uv_da != nullptr) level = LevelLanes(FootprintLanes(point.slopes, input.levels[0].size));
    if (at.bias != nullptr) level = hn::Add(level, hn::LoadU(kLanes, at.bias + i));
    const RunVec last = hn::Set(kLanes, static_cast<float>(input.levels.size() - 1));
    const RunMask above = hn::And(point.valid, hn::Gt(level, zero));
    const RunVec kept = hn::IfThenElseZero(above, hn::Min(level, last));
    fine = hn::ConvertTo(kIntLanes, kept);  // towards zero: the floor
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
    const RunVec size = hn::ConvertTo(kLanes, n), zero = hn::Zero(kLanes);
    const RunInt last = hn::Sub(n, hn::Set(kIntLanes, 1)), none = hn::Set(kIntLanes, -1);
    if (input.boundary == TextureBoundary::kWrap) s = hn::Sub(s, hn::Floor(s));
    RunVec x = hn::Mul(s, size);
    weight = slope = zero;
    if (input.filter == TextureFilter::kNearest) {
      // Far away is outside, too, and must fit into an integer.
      const RunVec cell = hn::Floor(hn::Min(hn::Max(x, hn::Set(kLanes, -1.0f)), size));
      low = hn::Max(none, hn::Min(hn::ConvertTo(kIntLanes, cell), n));
      if (input.boundary != TextureBoundary::kZero)
        low = hn::Max(hn::Zero(kIntLanes), hn::Min(low, last));
      high = low;
      return;
    }
    x = hn::Sub(x, hn::Set(kLanes, 0.5f));
    slope = size;
    RunMask inside = hn::And(hn::Gt(x, hn::Set(kLanes, -1.0f)), hn::Lt(x, size));
    if (input.boundary == TextureBoundary::kClamp) {
      inside = hn::And(hn::Gt(x, zero), hn::Lt(x, hn::ConvertTo(kLanes, last)));
      x = hn::Min(hn::Max(x, zero), hn::ConvertTo(kLanes, last));
      slope = hn::IfThenElseZero(inside, slope);
    } else {
      x = hn::Min(hn::Max(x, hn::Set(kLanes, -1.0f)), size);
    }
    const RunVec cell = hn::Floor(x);
    low = hn::Max(none, hn::Min(hn::ConvertTo(kIntLanes, cell), last));
    high = hn::Add(low, hn::Set(kIntLanes, 1));
    weight = hn::Sub(x, cell);
    SetBeyond(input.boundary, hn::RebindMask(kIntLanes, inside), n);
  }

 private:
  HWY_INLINE void SetBeyond(TextureBoundary boundary, hn::Mask<RunIntTag> inside, RunInt n) {
    const RunInt zero = hn::Zero(kIntLanes), last = hn::Sub(n, hn::Set(kIntLanes, 1));
    if (boundary == TextureBoundary::kWrap) {
      low = hn::IfThenElse(hn::Lt(low, zero), last, low);
      high = hn::IfThenElse(hn::Gt(high, last), zero, high);
    } else if (boundary == TextureBoundary::kClamp) {
      low = hn::Max(low, zero);
      high = hn::IfThenElse(inside, hn::Min(high, last), low);
      weight = hn::IfThenElseZero(hn::RebindMask(kLanes, inside), weight);
    } else if (boundary == TextureBoundary::kZero) {
      low = hn::IfThenElse(inside, low, n);
      high = hn::IfThenElse(inside, high, n);
    }
  }
};

// The texel in column x and row y of a face, negative outside.
struct TexelLanes {
  RunInt width, height, face, first;
  bool outside;  // some taps may be

  HWY_INLINE RunInt At(RunInt x, RunInt y) const {
    const RunInt texel = hn::Add(hn::Add(first, hn::Mul(y, width)), x);
    if (!outside) return texel;
    const auto in = [&](RunInt v, RunInt n) HWY_ATTR {
      return hn::And(hn::Gt(v, hn::Set(kIntLanes, -1)), hn::Lt(v, n));
    };
    return hn::IfThenElse(hn::And(in(x, width), in(y, height)), texel,
                          hn::Set(kIntLanes, static_cast<std::int32_t>(Taps::kNothing)));
  }
};

// Texels across the edges of a cube's faces, one by one, if a vector of pixels from `i` on has any.
inline HWY_NOINLINE void CrossEdges(const MipSize& size, const AxisLanes& x, const AxisLanes& y,
                                    RunInt face, hn::Mask<RunIntTag> cross, std::size_t i,
                                    TapRun* out) {
  HWY_ALIGN std::int32_t columns[2][16], rows[2][16], faces[16];
  face = hn::IfThenElse(cross, face, hn::Set(kIntLanes, -1));
  hn::Store(x.low, kIntLanes, columns[0]);
  hn::Store(x.high, kIntLanes, columns[1]);
  hn::Store(y.low, kIntLanes, rows[0]);
  hn::Store(y.high, kIntLanes, rows[1]);
  hn::Store(face, kIntLanes, faces);
  for (std::size_t p = 0; p < hn::Lanes(kIntLanes); ++p) {
    if (faces[p] < 0) continue;
    const int side = HWY_MAX(1, size.width >> HWY_MAX(out->level[i + p], 0));
    for (int k = 0; k < 4; ++k) {
      out->texel[i + p][k] = static_cast<std::int32_t>(TexelAt(
          columns[k % 2][p], rows[k / 2][p], faces[p], {side, side}, TextureBoundary::kCube));
    }
  }
}

// Fills the taps of pixels i to i + lanes - 1 at `level`. Negative levels and invalid pixels have
// none.
HWY_INLINE void SetTaps(const TextureInput<float>& input, const PointLanes& point, RunInt level,
                        RunVec share, std::size_t i, TapRun* out) {
  const RunInt one = hn::Set(kIntLanes, 1),
               none = hn::Set(kIntLanes, static_cast<std::int32_t>(Taps::kNothing));
  const RunInt shift = hn::Max(level, hn::Zero(kIntLanes));
  const MipSize& base = input.levels[0].size;
  TexelLanes texels;
  texels.width = hn::Max(hn::Shr(hn::Set(kIntLanes, base.width), shift), one);
  texels.height = hn::Max(hn::Shr(hn::Set(kIntLanes, base.height), shift), one);
  const RunInt of_face = hn::Mul(texels.width, texels.height);
  texels.first = hn::Mul(point.face, of_face);
  texels.outside =
      input.boundary == TextureBoundary::kZero || input.boundary == TextureBoundary::kCube;
  const AxisLanes x(point.st[0], texels.width, input), y(point.st[1], texels.height, input);
  RunInt at[4] = {texels.At(x.low, y.low), texels.At(x.high, y.low), texels.At(x.low, y.high),
                  texels.At(x.high, y.high)};
  const auto there =
      hn::And(hn::RebindMask(kIntLanes, point.valid), hn::Gt(level, hn::Set(kIntLanes, -1)));
  for (RunInt& t : at) t = hn::IfThenElse(there, t, none);
  // From the last texels on quads reach beyond the level.
  const auto n = static_cast<std::int32_t>(input.channels);
  const RunInt end = hn::Mul(of_face, hn::Set(kIntLanes, static_cast<std::int32_t>(input.faces())));
  const RunInt most = hn::Sub(end, hn::Set(kIntLanes, ((n + 3) / 4 * 4 + n - 1) / n));
  const RunInt reach = hn::Max(hn::Max(at[0], at[1]), hn::Max(at[2], at[3]));
  const RunInt least = hn::Or(hn::Or(at[0], at[1]), hn::Or(at[2], at[3]));
  hn::Store(hn::Or(least, hn::Sub(most, reach)), kIntLanes, out->whole + i);
  hn::Store(level, kIntLanes, out->level + i);
  hn::StoreInterleaved4(at[0], at[1], at[2], at[3], kIntLanes, out->texel[i]);
  const RunVec b1 = hn::Mul(share, y.weight), b0 = hn::Sub(share, b1);
  const RunVec w1 = hn::Mul(x.weight, b0), w3 = hn::Mul(x.weight, b1);
  hn::StoreInterleaved4(hn::Sub(b0, w1), w1, hn::Sub(b1, w3), w3, kLanes, out->weight[i]);
  hn::Store(x.weight, kLanes, out->a + i);
  hn::Store(y.weight, kLanes, out->b + i);
  hn::Store(x.slope, kLanes, out->slope_a + i);
  hn::Store(y.slope, kLanes, out->slope_b + i);
  const auto cross = hn::And(there, hn::Lt(least, hn::Zero(kIntLanes)));
  if (input.boundary != TextureBoundary::kCube || hn::AllFalse(kIntLanes, cross)) return;
  CrossEdges(base, x, y, point.face, cross, i, out);
}

// The lookups of a run.
HWY_INLINE void LookUp(const TextureInput<float>& input, const RunCoordinates& at, LookupRun* out) {
  out->mixes = false;
  for (std::size_t i = 0; i < at.count; i += hn::Lanes(kLanes)) {
    const PointLanes point = FindPoints(input, at, i);
    const LevelLanesOf levels(input, at, i, point);
    SetTaps(input, point, levels.fine, hn::Sub(hn::Set(kLanes, 1.0f), levels.mix), i,
            &out->taps[0]);
    hn::Store(levels.mix, kLanes, out->mix + i);
    if (hn::AllFalse(kLanes, levels.mixes)) {
      hn::Store(hn::Set(kIntLanes, -1), kIntLanes, out->taps[1].level + i);
      continue;
    }
    const RunInt coarse =
        hn::IfThenElse(hn::RebindMask(kIntLanes, levels.mixes),
                       hn::Add(levels.fine, hn::Set(kIntLanes, 1)), hn::Set(kIntLanes, -1));
    SetTaps(input, point, coarse, levels.mix, i, &out->taps[1]);
    out->mixes = true;
  }
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of texture_point.h: the points on a texture that pixels look up, their footprints and
// levels, and the adjoints. Lanes are pixels of a run; float.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_POINT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_POINT_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_POINT_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_TEXTURE_POINT_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <span>

#include "compat/nvdiffrast/texture.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using RunTag = HWY_CAPPED(float, 16);
using RunIntTag = hn::RebindToSigned<RunTag>;
using RunVec = hn::Vec<RunTag>;
using RunInt = hn::Vec<RunIntTag>;
using RunMask = hn::Mask<RunTag>;
inline constexpr std::size_t kRun = 128;  // pixels: what is known of them stays in the first cache

// Coordinates of a run: those of the images, or a padded copy at their end.
struct RunCoordinates {
  const float *uv, *uv_da = nullptr, *bias = nullptr;
  alignas(128) float padded[kRun * 10];

  HWY_INLINE RunCoordinates(const TextureInput<float>& input, std::size_t first,
                            std::size_t count) {
    const std::size_t n = input.coordinates();
    float* free = padded;
    const auto place = [&](std::span<const float> from, std::size_t numbers) -> const float* {
      if (from.empty()) return nullptr;
      const float* at = from.data() + first * numbers;
      if (count % hn::Lanes(RunTag()) == 0) return at;
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

// TexturePoint of texture_point.h. Of cube maps also the direction along the axes of its face: p
// and q are s and t in [-1, 1].
struct PointLanes {
  RunVec st[2], slopes[4];
  RunMask valid;
  RunInt face;
  RunMask axis[3];
  RunVec sign, major, ratio[2];  // of the largest component; its length; p, q
  RunVec d_major[2];             // by X and Y
};

HWY_INLINE RunMask FiniteLanes(RunVec v) { return hn::Eq(hn::Sub(v, v), hn::Zero(RunTag())); }

// Where a vector (x, y, z) lies along the axes of faces: kCubeFaces of texture_cube.h.
struct FaceFrame {
  RunVec s, t, major;

  HWY_INLINE FaceFrame(const PointLanes& p, RunVec x, RunVec y, RunVec z) {
    const RunVec sx = hn::Mul(p.sign, x), sy = hn::Mul(p.sign, y), sz = hn::Mul(p.sign, z);
    s = hn::IfThenElse(p.axis[0], hn::Neg(sz), hn::IfThenElse(p.axis[1], x, sx));
    t = hn::IfThenElse(p.axis[1], sz, hn::Neg(y));
    major = hn::IfThenElse(p.axis[0], sx, hn::IfThenElse(p.axis[1], sy, sz));
  }
};
// And back.
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
  const RunTag d;
  hn::LoadInterleaved2(d, at.uv + 2 * i, out->st[0], out->st[1]);
  out->valid = hn::And(FiniteLanes(out->st[0]), FiniteLanes(out->st[1]));
  out->face = hn::Zero(RunIntTag());
  if (at.uv_da == nullptr) return;
  hn::LoadInterleaved4(d, at.uv_da + 4 * i, out->slopes[0], out->slopes[1], out->slopes[2],
                       out->slopes[3]);
}

HWY_INLINE void FindAxes(const RunVec (&r)[3], PointLanes* out) {
  const RunTag d;
  const RunIntTag di;
  const RunVec x = hn::Abs(r[0]), y = hn::Abs(r[1]), z = hn::Abs(r[2]);
  out->axis[2] = hn::Gt(z, hn::Max(x, y));
  out->axis[1] = hn::AndNot(out->axis[2], hn::Gt(y, x));
  out->axis[0] = hn::Not(hn::Or(out->axis[1], out->axis[2]));
  const RunVec largest =
      hn::IfThenElse(out->axis[0], r[0], hn::IfThenElse(out->axis[1], r[1], r[2]));
  const RunMask negative = hn::Lt(largest, hn::Zero(d));
  out->valid =
      hn::And(hn::Ne(largest, hn::Zero(d)), FiniteLanes(hn::Add(r[0], hn::Add(r[1], r[2]))));
  out->sign = hn::IfThenElse(negative, hn::Set(d, -1.0f), hn::Set(d, 1.0f));
  const auto number = [&](const RunMask& mask, std::int32_t v) HWY_ATTR {
    return hn::IfThenElseZero(hn::RebindMask(di, mask), hn::Set(di, v));
  };
  out->face =
      hn::Add(number(negative, 1), hn::Add(number(out->axis[1], 2), number(out->axis[2], 4)));
}

HWY_INLINE void FindCubePoints(const RunCoordinates& at, std::size_t i, PointLanes* out) {
  const RunTag d;
  RunVec r[3];
  hn::LoadInterleaved3(d, at.uv + 3 * i, r[0], r[1], r[2]);
  FindAxes(r, out);
  const FaceFrame frame(*out, r[0], r[1], r[2]);
  const RunVec half = hn::Set(d, 0.5f);
  out->major = frame.major;
  out->ratio[0] = hn::Div(frame.s, frame.major);
  out->ratio[1] = hn::Div(frame.t, frame.major);
  for (int k = 0; k < 2; ++k) out->st[k] = hn::MulAdd(half, out->ratio[k], half);
  if (at.uv_da == nullptr) return;
  RunVec x[2], y[2], z[2];
  HWY_ALIGN float planes[6][16];
  for (std::size_t p = 0; p < hn::Lanes(d); ++p) {
    for (std::size_t k = 0; k < 6; ++k) planes[k][p] = at.uv_da[6 * (i + p) + k];
  }
  for (int k = 0; k < 2; ++k) {
    x[k] = hn::Load(d, planes[k]);
    y[k] = hn::Load(d, planes[2 + k]);
    z[k] = hn::Load(d, planes[4 + k]);
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
  // Adjoints multiply both by 0 where there are no derivatives: garbage may be NaN.
  for (RunVec& s : out.slopes) s = hn::Zero(RunTag());
  for (RunVec& m : out.d_major) m = hn::Zero(RunTag());
  if (input.boundary == TextureBoundary::kCube) {
    FindCubePoints(at, i, &out);
  } else {
    FindPlainPoints(at, i, &out);
  }
  for (RunVec& s : out.st) s = hn::IfThenElseZero(out.valid, s);  // weights are numbers, then
  return out;
}

// 2^e for e in [-126, 127].
HWY_INLINE RunVec PowerOfTwo(RunInt e) {
  return hn::BitCast(RunTag(), hn::ShiftLeft<23>(hn::Add(e, hn::Set(RunIntTag(), 127))));
}

// Footprint of texture_point.cc: J times 2^-exponent, so that no square overflows. Powers of two
// keep their digits.
struct FootprintLanes {
  RunInt exponent;
  RunVec scale[2], j[4];
  RunVec half, c, root, square;

  HWY_INLINE FootprintLanes(const RunVec (&slopes)[4], const MipSize& size) {
    const RunTag d;
    const RunIntTag di;
    RunVec largest = hn::Zero(d);
    for (int i = 0; i < 4; ++i) {
      j[i] = hn::Mul(slopes[i], hn::Set(d, static_cast<float>(i < 2 ? size.width : size.height)));
      largest = hn::Max(largest, hn::Abs(j[i]));
    }
    exponent = hn::Sub(hn::ShiftRight<23>(hn::BitCast(di, largest)), hn::Set(di, 127));
    exponent = hn::Max(hn::Min(exponent, hn::Set(di, 126)), hn::Set(di, -126));
    const RunVec down = PowerOfTwo(hn::Neg(exponent));
    scale[0] = hn::Mul(down, hn::Set(d, static_cast<float>(size.width)));
    scale[1] = hn::Mul(down, hn::Set(d, static_cast<float>(size.height)));
    for (RunVec& v : j) v = hn::Mul(v, down);
    const RunVec a = hn::MulAdd(j[0], j[0], hn::Mul(j[2], j[2]));
    const RunVec b = hn::MulAdd(j[1], j[1], hn::Mul(j[3], j[3]));
    const RunVec one_half = hn::Set(d, 0.5f);
    half = hn::Mul(one_half, hn::Sub(a, b));
    c = hn::MulAdd(j[0], j[1], hn::Mul(j[2], j[3]));
    root = hn::Sqrt(hn::MulAdd(half, half, hn::Mul(c, c)));
    square = hn::MulAdd(one_half, hn::Add(a, b), root);
  }
};

// Of x > 0; exact where x is a power of two.
HWY_INLINE RunVec Log2Lanes(RunVec x) {
  const RunTag d;
  const RunIntTag di;
  // x = 2^e m, m in [sqrt(1/2), sqrt(2)).
  const RunInt bits = hn::BitCast(di, x);
  const RunInt e = hn::Sub(hn::ShiftRight<23>(hn::Add(bits, hn::Set(di, 0x3f800000 - 0x3f3504f3))),
                           hn::Set(di, 127));
  const RunVec m = hn::BitCast(d, hn::Sub(bits, hn::ShiftLeft<23>(e)));
  return hn::MulAdd(hn::Log(d, m), hn::Set(d, std::numbers::log2e_v<float>), hn::ConvertTo(d, e));
}

// LevelOf of texture_point.h.
HWY_INLINE RunVec LevelLanes(const FootprintLanes& f) {
  const RunTag d;
  const RunVec level =
      hn::MulAdd(hn::Set(d, 0.5f), Log2Lanes(f.square), hn::ConvertTo(d, f.exponent));
  return hn::IfThenElse(hn::Gt(f.square, hn::Zero(d)), level,
                        hn::Set(d, -std::numeric_limits<float>::infinity()));
}

// LevelAdjoint of texture_point.h.
HWY_INLINE void LevelAdjointLanes(const FootprintLanes& f, RunVec d_level, RunVec (&d_slopes)[4]) {
  const RunTag d;
  const RunVec zero = hn::Zero(d), half = hn::Set(d, 0.5f), two = hn::Set(d, 2.0f);
  const RunMask oval = hn::Gt(f.root, zero), some = hn::Gt(f.square, zero);
  const RunVec cosine = hn::IfThenElseZero(oval, hn::Div(f.half, f.root));
  const RunVec sine = hn::IfThenElseZero(oval, hn::Div(f.c, f.root));
  const RunVec d_square = hn::IfThenElseZero(
      hn::And(some, hn::Ne(d_level, zero)),
      hn::Div(hn::Mul(d_level, hn::Set(d, 0.5f / std::numbers::ln2_v<float>)), f.square));
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

// PointAdjoint of texture_point.h for a cube map: d_uv [3], d_uv_da [6].
HWY_INLINE void CubeAdjointLanes(const PointLanes& p, const RunVec (&d_st)[2],
                                 const RunVec (&d_slopes)[4], RunVec (&d_uv)[3],
                                 RunVec (&d_uv_da)[6]) {
  const RunTag d;
  const RunVec half = hn::Set(d, 0.5f), inverse = hn::Div(hn::Set(d, 1.0f), p.major);
  RunVec axis[2], d_major = hn::Zero(d), by_axis[2][2], by_major[2] = {hn::Zero(d), hn::Zero(d)};
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

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

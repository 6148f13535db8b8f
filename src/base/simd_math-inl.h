// SPDX-License-Identifier: Apache-2.0
// Elementary functions on Highway vectors of float, with proven error. For kernels only.

#if defined(TILEGRAD_BASE_SIMD_MATH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_BASE_SIMD_MATH_INL_H_
#undef TILEGRAD_BASE_SIMD_MATH_INL_H_
#else
#define TILEGRAD_BASE_SIMD_MATH_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tilegrad::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// exp(-z) and 1 - exp(-z).
template <class V>
struct Decay {
  V exp;
  V one_minus;
};

// Beyond it, DecayOf gives exp = 0, one_minus = 1. exp(-87) is about 2^-125.5: always normal.
inline constexpr float kDecayEnd = 87.0f;

// exp(-z) for z >= 0, infinity included; z = 0 gives exactly 1. Relative error at most 3 u for
// exp, where it is not cut off, and 4 u for one_minus down to z -> 0; u = 2^-24. By
// -z = n ln 2 + r, |r| <= ln(2) / 2, exp(-z) = 2^n (1 + p), 1 - exp(-z) = (1 - 2^n) - 2^n p; and
// p = expm1(r) = r + r^2 q(r) with a interpolant q of degree 4 (relative error of 1 + p: 1e-08).
template <class D, class V = hn::Vec<D>>
HWY_INLINE Decay<V> DecayOf(D d, V z) {
  const hn::RebindToSigned<D> di;
  const V x = hn::Neg(hn::Min(z, hn::Set(d, kDecayEnd)));
  const auto n = hn::NearestInt(hn::Mul(x, hn::Set(d, 1.44269504f)));
  const V nf = hn::ConvertTo(d, n);
  // ln 2 in two parts, the first of which has few bits: its product with n is exact.
  V r = hn::NegMulAdd(nf, hn::Set(d, 0.693359375f), x);
  r = hn::NegMulAdd(nf, hn::Set(d, -2.12194440e-4f), r);
  V q = hn::MulAdd(hn::Set(d, 0.00139262679f), r, hn::Set(d, 0.00836324692f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.0416665524f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.166665763f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.5f));
  const V p = hn::MulAdd(hn::Mul(r, r), q, r);
  const V two_n = hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(n, hn::Set(di, 127))));
  const V one = hn::Set(d, 1.0f);
  const auto end = hn::Ge(z, hn::Set(d, kDecayEnd));
  return {hn::IfThenZeroElse(end, hn::MulAdd(two_n, p, two_n)),
          hn::NegMulAdd(two_n, p, hn::Sub(one, two_n))};
}

}  // namespace tilegrad::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

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

// first, first + 1, ... by lane. hn::Iota of a variable goes through memory, element by element,
// and stalls on the load.
template <class D>
HWY_INLINE hn::Vec<D> CountFrom(D d, hn::TFromD<D> first) {
  return hn::Add(hn::Iota(d, 0), hn::Set(d, first));
}

// 2^-z and 1 - 2^-z.
template <class V>
struct Exp2NegPair {
  V power;
  V one_minus;
};

// 2^-z for z >= 0, infinity included; z = 0 gives exactly 1, z >= 126.5 exactly 0. Relative error
// at most 3 u for power, up to where it becomes denormal (z > 126), and 4 u for one_minus, for z
// near 0 too; u = 2^-24. With z = n - r, |r| <= 1/2, r is exact, and
//
//   2^-z = 2^-n (1 + p),   1 - 2^-z = (1 - 2^-n) - 2^-n p,   p = 2^r - 1 = r q(r)
//
// with an interpolant q of degree 5 (relative error of 1 + p: 1e-8).
template <class D, class V = hn::Vec<D>>
HWY_INLINE Exp2NegPair<V> Exp2Neg(D d, V z) {
  const hn::RebindToSigned<D> di;
  const V most = hn::Min(z, hn::Set(d, 127.0f));
  // Adding 1.5 2^23 rounds to an integer, which then stands in the lowest bits.
  const V shifter = hn::Set(d, 0x1.8p23f), shifted = hn::Add(most, shifter);
  const V r = hn::Sub(hn::Sub(shifted, shifter), most);
  V q = hn::MulAdd(hn::Set(d, 0.000154531634f), r, hn::Set(d, 0.00133908633f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.00961808302f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.0555035695f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.240226507f));
  q = hn::MulAdd(q, r, hn::Set(d, 0.693147182f));
  const V p = hn::Mul(q, r);
  // n = 127 gives the bits of 0.
  const auto n = hn::ShiftLeft<23>(hn::BitCast(di, shifted));
  const V two_n = hn::BitCast(d, hn::Sub(hn::Set(di, 127 << 23), n));
  return {hn::MulAdd(two_n, p, two_n), hn::NegMulAdd(two_n, p, hn::Sub(hn::Set(d, 1.0f), two_n))};
}

}  // namespace tilegrad::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// Vector body of adam.h. Memory-bound by seven streams, which hide the square root and the
// division.
#if defined(TILEGRAD_NN_ADAM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_ADAM_INL_H_
#undef TILEGRAD_NN_ADAM_INL_H_
#else
#define TILEGRAD_NN_ADAM_INL_H_
#endif

#include <hwy/highway.h>

#include "nn/kernels/adam_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// The formulas of adam.h on vectors.
struct AdamRule {
  // Written out: a default member initialiser would not be compiled for the target.
  HWY_INLINE explicit AdamRule(const AdamCoefficients& c)
      : beta1(Set(c.beta1)),
        rest1(Set(1 - c.beta1)),
        beta2(Set(c.beta2)),
        rest2(Set(1 - c.beta2)),
        root(Set(c.inverse_root)),
        epsilon(Set(c.epsilon)),
        step(Set(c.step)),
        keep(Set(c.keep)) {}

  // `count` numbers: a whole vector or a tail.
  HWY_INLINE void Update(VF g, float* parameter, float* m_at, float* v_at,
                         std::size_t count) const {
    const DF d;
    const VF m = hn::MulAdd(beta1, LoadSome(d, m_at, count), hn::Mul(rest1, g));
    const VF v = hn::MulAdd(beta2, LoadSome(d, v_at, count), hn::Mul(rest2, hn::Mul(g, g)));
    const VF denominator = hn::MulAdd(hn::Sqrt(v), root, epsilon);
    const VF p = hn::Mul(keep, LoadSome(d, parameter, count));
    StoreSome(m, d, m_at, count);
    StoreSome(v, d, v_at, count);
    StoreSome(hn::Sub(p, hn::Div(hn::Mul(step, m), denominator)), d, parameter, count);
  }

  VF beta1, rest1, beta2, rest2, root, epsilon, step, keep;

 private:
  static HWY_INLINE VF Set(double x) { return hn::Set(DF(), static_cast<float>(x)); }
};

inline void AdamRange(const AdamProblem<float>& problem, std::size_t begin, std::size_t end) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  const AdamRule rule(problem.coefficients);
  for (std::size_t i = begin; i < end; i += lanes) {
    const std::size_t count = HWY_MIN(lanes, end - i);
    rule.Update(LoadSome(d, problem.gradient + i, count), problem.parameter + i, problem.m + i,
                problem.v + i, count);
  }
}

// In double, two halves of each vector of floats apart.
inline double SquaresRange(const float* x, std::size_t n) {
  const hn::Repartition<double, DF> dd;
  const hn::Half<DF> half;
  const std::size_t lanes = hn::Lanes(half);
  auto even = hn::Zero(dd), odd = hn::Zero(dd);
  std::size_t i = 0;
  for (; i + 2 * lanes <= n; i += 2 * lanes) {
    const auto a = hn::PromoteTo(dd, hn::LoadU(half, x + i));
    const auto b = hn::PromoteTo(dd, hn::LoadU(half, x + i + lanes));
    even = hn::MulAdd(a, a, even);
    odd = hn::MulAdd(b, b, odd);
  }
  return hn::GetLane(hn::SumOfLanes(dd, hn::Add(even, odd))) + SumOfSquaresRef(x + i, n - i);
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

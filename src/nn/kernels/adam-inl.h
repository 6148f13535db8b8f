// SPDX-License-Identifier: Apache-2.0
// Vector body of adam.h. Seven streams of memory bound it; the square root and the division hide
// behind them.
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

void AdamRange(const AdamProblem<float>& problem, std::size_t begin, std::size_t end) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  const AdamCoefficients& c = problem.coefficients;
  const VF scale = hn::Set(d, static_cast<float>(c.gradient_scale));
  const VF beta1 = hn::Set(d, static_cast<float>(c.beta1));
  const VF rest1 = hn::Set(d, static_cast<float>(1 - c.beta1));
  const VF beta2 = hn::Set(d, static_cast<float>(c.beta2));
  const VF rest2 = hn::Set(d, static_cast<float>(1 - c.beta2));
  const VF root = hn::Set(d, static_cast<float>(c.inverse_root));
  const VF epsilon = hn::Set(d, static_cast<float>(c.epsilon));
  const VF step = hn::Set(d, static_cast<float>(c.step));
  const VF keep = hn::Set(d, static_cast<float>(c.keep));
  for (std::size_t i = begin; i < end; i += lanes) {
    const std::size_t count = HWY_MIN(lanes, end - i);
    const VF g = hn::Mul(scale, LoadSome(d, problem.gradient + i, count));
    const VF m = hn::MulAdd(beta1, LoadSome(d, problem.m + i, count), hn::Mul(rest1, g));
    const VF v =
        hn::MulAdd(beta2, LoadSome(d, problem.v + i, count), hn::Mul(rest2, hn::Mul(g, g)));
    const VF denominator = hn::MulAdd(hn::Sqrt(v), root, epsilon);
    const VF p = hn::Mul(keep, LoadSome(d, problem.parameter + i, count));
    StoreSome(m, d, problem.m + i, count);
    StoreSome(v, d, problem.v + i, count);
    StoreSome(hn::Sub(p, hn::Div(hn::Mul(step, m), denominator)), d, problem.parameter + i, count);
  }
}

// In double, two halves of each vector of floats apart.
double SquaresRange(const float* x, std::size_t n) {
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

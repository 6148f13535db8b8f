// SPDX-License-Identifier: Apache-2.0
// Vector body of pointwise.h. Any length and alignment: a tail goes through a buffer of one vector,
// so an element's bits do not depend on its position.

#include <hwy/highway.h>

#include "nn/kernels/pointwise_ref.h"
//
#include <hwy/contrib/math/math-inl.h>

#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Above this, e^x exceeds the largest float.
constexpr float kExpOverflow = 88.72284f;

// Highway's exp, log and tanh with the limits and the NaN of the C library.
HWY_INLINE VF SafeExp(DF d, VF x) {
  const VF y = hn::IfThenElse(hn::Gt(x, hn::Set(d, kExpOverflow)), hn::Inf(d), hn::Exp(d, x));
  return hn::IfThenElse(hn::IsNaN(x), x, y);
}
HWY_INLINE VF SafeLog(DF d, VF x) {
  const VF zero = hn::Zero(d);
  VF y = hn::IfThenElse(hn::Eq(x, zero), hn::Neg(hn::Inf(d)), hn::Log(d, x));
  y = hn::IfThenElse(hn::Lt(x, zero), hn::NaN(d), y);
  return hn::IfThenElse(hn::Or(hn::IsNaN(x), hn::Eq(x, hn::Inf(d))), x, y);
}
HWY_INLINE VF SafeTanh(DF d, VF x) {
  // At 10, tanh is within 5e-9 of 1, which is 1 in float.
  const VF limit = hn::Set(d, 10.0f);
  const VF y = hn::Tanh(d, hn::Min(hn::Max(x, hn::Neg(limit)), limit));
  return hn::IfThenElse(hn::IsNaN(x), x, y);
}

HWY_INLINE VF Softplus(DF d, VF x) {
  const VF y = hn::Log1p(d, SafeExp(d, hn::Neg(hn::Abs(x))));
  return hn::IfThenElse(hn::IsNaN(x), x, hn::Add(hn::Max(x, hn::Zero(d)), y));
}

// kOp is a constant of each loop: the switch costs nothing.
template <UnaryOp kOp>
HWY_INLINE VF ApplyUnary(DF d, VF x, VF p) {
  const VF zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  switch (kOp) {
    case UnaryOp::kNeg:
      return hn::Neg(x);
    case UnaryOp::kScale:
      return hn::Mul(p, x);
    case UnaryOp::kAddScalar:
      return hn::Add(x, p);
    case UnaryOp::kExp:
      return SafeExp(d, x);
    case UnaryOp::kLog:
      return SafeLog(d, x);
    case UnaryOp::kSqrt:
      return hn::Sqrt(x);
    case UnaryOp::kSquare:
      return hn::Mul(x, x);
    case UnaryOp::kAbs:
      return hn::Abs(x);
    case UnaryOp::kSign:
      return hn::IfThenElse(hn::Or(hn::Eq(x, zero), hn::IsNaN(x)), x, hn::CopySign(one, x));
    case UnaryOp::kRelu:
      return hn::IfThenElse(hn::Le(x, zero), zero, x);
    case UnaryOp::kLeakyRelu:
      return hn::IfThenElse(hn::Gt(x, zero), x, hn::Mul(p, x));
    case UnaryOp::kTanh:
      return SafeTanh(d, x);
    case UnaryOp::kSigmoid:
      return hn::Div(one, hn::Add(one, SafeExp(d, hn::Neg(x))));
    case UnaryOp::kSoftplus:
      return Softplus(d, x);
  }
  return x;
}

template <UnaryOp kOp>
void UnaryLoop(const UnaryProblem<float>& problem, std::size_t begin, std::size_t end) {
  const DF d;
  const VF p = hn::Set(d, static_cast<float>(problem.p));
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = begin;
  for (; i + lanes <= end; i += lanes) {
    hn::StoreU(ApplyUnary<kOp>(d, hn::LoadU(d, problem.x + i), p), d, problem.y + i);
  }
  if (i == end) return;
  const VF tail = ApplyUnary<kOp>(d, LoadTail(d, problem.x + i, end - i), p);
  StoreTail(tail, d, problem.y + i, end - i);
}

void UnaryRange(const UnaryProblem<float>& problem, std::size_t begin, std::size_t end) {
  switch (problem.op) {
#define TILEGRAD_CASE(kName) \
  case UnaryOp::kName:       \
    return UnaryLoop<UnaryOp::kName>(problem, begin, end)
    TILEGRAD_CASE(kNeg);
    TILEGRAD_CASE(kScale);
    TILEGRAD_CASE(kAddScalar);
    TILEGRAD_CASE(kExp);
    TILEGRAD_CASE(kLog);
    TILEGRAD_CASE(kSqrt);
    TILEGRAD_CASE(kSquare);
    TILEGRAD_CASE(kAbs);
    TILEGRAD_CASE(kSign);
    TILEGRAD_CASE(kRelu);
    TILEGRAD_CASE(kLeakyRelu);
    TILEGRAD_CASE(kTanh);
    TILEGRAD_CASE(kSigmoid);
    TILEGRAD_CASE(kSoftplus);
#undef TILEGRAD_CASE
  }
}

template <BinaryOp kOp>
HWY_INLINE VF ApplyBinary(DF d, VF a, VF b, VF p) {
  const VF zero = hn::Zero(d);
  switch (kOp) {
    case BinaryOp::kAdd:
      return hn::Add(a, b);
    case BinaryOp::kSub:
      return hn::Sub(a, b);
    case BinaryOp::kMul:
      return hn::Mul(a, b);
    case BinaryOp::kDiv:
      return hn::Div(a, b);
    case BinaryOp::kReluGrad:
      return hn::IfThenElseZero(hn::Gt(a, zero), b);
    case BinaryOp::kLeakyReluGrad:
      return hn::IfThenElse(hn::Gt(a, zero), b, hn::Mul(p, b));
  }
  return a;
}

// kStepA, kStepB: 1 reads along the row, 0 repeats one number.
template <int kStep>
HWY_INLINE VF LoadStep(DF d, const float* from) {
  return kStep == 0 ? hn::Set(d, *from) : hn::LoadU(d, from);
}
template <int kStep>
HWY_INLINE VF LoadStepTail(DF d, const float* from, std::size_t count) {
  return kStep == 0 ? hn::Set(d, *from) : LoadTail(d, from, count);
}

template <BinaryOp kOp, int kStepA, int kStepB>
void BinaryLoop(const BinaryProblem<float>& problem, const RowRange& range) {
  const DF d;
  const VF p = hn::Set(d, static_cast<float>(problem.p));
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t row = range.first; row < range.last; ++row) {
    const RowOffsets offsets = OffsetsOfRow(problem, row);
    const float* a = problem.a + offsets.a;
    const float* b = problem.b + offsets.b;
    float* y = problem.y + row * problem.extents.back();
    std::size_t i = range.begin;
    for (; i + lanes <= range.end; i += lanes) {
      const VF va = LoadStep<kStepA>(d, a + i * kStepA), vb = LoadStep<kStepB>(d, b + i * kStepB);
      hn::StoreU(ApplyBinary<kOp>(d, va, vb, p), d, y + i);
    }
    if (i == range.end) continue;
    const VF va = LoadStepTail<kStepA>(d, a + i * kStepA, range.end - i);
    const VF vb = LoadStepTail<kStepB>(d, b + i * kStepB, range.end - i);
    StoreTail(ApplyBinary<kOp>(d, va, vb, p), d, y + i, range.end - i);
  }
}

template <BinaryOp kOp>
void BinarySteps(const BinaryProblem<float>& problem, const RowRange& range) {
  const bool along_a = problem.strides_a.back() != 0, along_b = problem.strides_b.back() != 0;
  if (along_a && along_b) return BinaryLoop<kOp, 1, 1>(problem, range);
  if (along_a) return BinaryLoop<kOp, 1, 0>(problem, range);
  if (along_b) return BinaryLoop<kOp, 0, 1>(problem, range);
  BinaryLoop<kOp, 0, 0>(problem, range);
}

void BinaryRange(const BinaryProblem<float>& problem, const RowRange& range) {
  switch (problem.op) {
#define TILEGRAD_CASE(kName) \
  case BinaryOp::kName:      \
    return BinarySteps<BinaryOp::kName>(problem, range)
    TILEGRAD_CASE(kAdd);
    TILEGRAD_CASE(kSub);
    TILEGRAD_CASE(kMul);
    TILEGRAD_CASE(kDiv);
    TILEGRAD_CASE(kReluGrad);
    TILEGRAD_CASE(kLeakyReluGrad);
#undef TILEGRAD_CASE
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

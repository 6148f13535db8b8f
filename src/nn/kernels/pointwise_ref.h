// SPDX-License-Identifier: Apache-2.0
// Scalar reference of pointwise.h. T: float, double or std::complex<double>; complex numbers
// compare by their real parts, as a complex step requires.
#pragma once

#include <cmath>
#include <complex>
#include <type_traits>

#include "nn/kernels/pointwise.h"

namespace tilegrad::nn {

template <class T>
double RealPart(const T& x) {
  return static_cast<double>(std::real(x));
}

// log(1 + x) without cancellation. For complex numbers, whose real part a complex step does not
// read, the plain formula.
template <class T>
T Log1pOf(const T& x) {
  if constexpr (std::is_floating_point_v<T>) {
    return std::log1p(x);
  } else {
    return std::log(T(1) + x);
  }
}

template <class T>
T UnaryRef(UnaryOp op, T x, double p) {
  const double real = RealPart(x);
  const T one(1), tp(static_cast<T>(p));
  switch (op) {
    case UnaryOp::kNeg:
      return -x;
    case UnaryOp::kScale:
      return tp * x;
    case UnaryOp::kAddScalar:
      return x + tp;
    case UnaryOp::kExp:
      return std::exp(x);
    case UnaryOp::kLog:
      return std::log(x);
    case UnaryOp::kSqrt:
      return std::sqrt(x);
    case UnaryOp::kSquare:
      return x * x;
    case UnaryOp::kAbs:
      return real < 0 ? -x : x;
    case UnaryOp::kSign:
      return real > 0 ? one : real < 0 ? -one : real == 0 ? T(0) : x;
    case UnaryOp::kRelu:
      return real <= 0 ? T(0) : x;
    case UnaryOp::kLeakyRelu:
      return real > 0 ? x : tp * x;
    case UnaryOp::kTanh:
      return std::tanh(x);
    case UnaryOp::kSigmoid:
      return one / (one + std::exp(-x));
    case UnaryOp::kSoftplus:
      return real > 0 ? x + Log1pOf(std::exp(-x)) : Log1pOf(std::exp(x));
  }
  return x;
}

template <class T>
T BinaryRef(BinaryOp op, T a, T b, double p) {
  const double ra = RealPart(a);
  switch (op) {
    case BinaryOp::kAdd:
      return a + b;
    case BinaryOp::kSub:
      return a - b;
    case BinaryOp::kMul:
      return a * b;
    case BinaryOp::kDiv:
      return a / b;
    case BinaryOp::kReluGrad:
      return ra > 0 ? b : T(0);
    case BinaryOp::kLeakyReluGrad:
      return ra > 0 ? b : static_cast<T>(p) * b;
  }
  return a;
}

// Offset of row `row` (all axes but the last) in each operand.
struct RowOffsets {
  std::size_t a = 0, b = 0;
};

template <class T>
RowOffsets OffsetsOfRow(const BinaryProblem<T>& problem, std::size_t row) {
  RowOffsets offsets;
  for (int axis = BinaryProblem<T>::kRank - 2; axis >= 0; --axis) {
    const auto i = static_cast<std::size_t>(axis);
    const std::size_t index = row % problem.extents[i];
    row /= problem.extents[i];
    offsets.a += index * problem.strides_a[i];
    offsets.b += index * problem.strides_b[i];
  }
  return offsets;
}

template <class T>
void UnaryRangeRef(const UnaryProblem<T>& problem, std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end; ++i) {
    problem.y[i] = UnaryRef(problem.op, problem.x[i], problem.p);
  }
}

// Elements [begin, end) of each of the rows [first, last).
struct RowRange {
  std::size_t first, last;
  std::size_t begin, end;
};

template <class T>
void BinaryRangeRef(const BinaryProblem<T>& problem, const RowRange& range) {
  const std::size_t length = problem.extents.back();
  const std::size_t step_a = problem.strides_a.back(), step_b = problem.strides_b.back();
  for (std::size_t row = range.first; row < range.last; ++row) {
    const RowOffsets offsets = OffsetsOfRow(problem, row);
    for (std::size_t i = range.begin; i < range.end; ++i) {
      problem.y[row * length + i] = BinaryRef(problem.op, problem.a[offsets.a + i * step_a],
                                              problem.b[offsets.b + i * step_b], problem.p);
    }
  }
}

}  // namespace tilegrad::nn

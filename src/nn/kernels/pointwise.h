// SPDX-License-Identifier: Apache-2.0
// Elementwise functions, and binary ones with broadcasting. Bits depend on the operands and the
// SIMD target, never on the number of workers.
#pragma once

#include <array>
#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::nn {

enum class UnaryOp {
  kNeg,
  kScale,      // p x
  kAddScalar,  // x + p
  kExp,
  kLog,
  kSqrt,
  kSquare,
  kAbs,
  kSign,  // -1, 0, 1
  kRelu,
  kLeakyRelu,  // x > 0 ? x : p x
  kTanh,
  kSigmoid,
  kSoftplus,  // log(1 + e^x)
};

enum class BinaryOp {
  kAdd,
  kSub,
  kMul,
  kDiv,
  kReluGrad,      // a > 0 ? b : 0
  kLeakyReluGrad  // a > 0 ? b : p b
};

template <class T>
struct UnaryProblem {
  UnaryOp op;
  const T* x = nullptr;  // [n]
  T* y = nullptr;        // [n]; may be x
  std::size_t n = 0;
  double p = 0;
};

// y[i0,..,i4] = f(a[sum i strides_a], b[sum i strides_b]); y is dense. The last axis has strides 0
// or 1; unused axes have extent 1.
template <class T>
struct BinaryProblem {
  static constexpr int kRank = 5;
  BinaryOp op;
  std::array<std::size_t, kRank> extents = {1, 1, 1, 1, 1};
  std::array<std::size_t, kRank> strides_a{}, strides_b{};
  const T* a = nullptr;
  const T* b = nullptr;
  T* y = nullptr;  // may be a or b if that one is dense
  double p = 0;
};

void Unary(const UnaryProblem<float>& problem, const Workers& workers);
void Unary(const UnaryProblem<double>& problem, const Workers& workers);  // scalar
void Binary(const BinaryProblem<float>& problem, const Workers& workers);
void Binary(const BinaryProblem<double>& problem, const Workers& workers);  // scalar

}  // namespace tilegrad::nn

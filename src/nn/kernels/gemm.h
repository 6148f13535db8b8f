// SPDX-License-Identifier: Apache-2.0
// Product of dense float matrices, the kernel under linear layers.
//
// The result's bits depend on the shapes, the options and the SIMD target, never on the number of
// workers: one worker sums each element of C in an order that depends on the shape only.
#pragma once

#include <cstddef>

#include "nn/kernels/kernel_context.h"

namespace tilegrad::nn {

// C[m,n] = op(A)[m,k] op(B)[k,n] (+ C) (+ bias), all row-major. Rows of a matrix are `ld...` floats
// apart. C must not overlap A, B or the bias. Any of m, n, k may be 0; an empty sum is 0.
template <class T>
struct GemmProblem {
  std::size_t m = 0, n = 0, k = 0;
  const T* a = nullptr;  // [m,k], or [k,m] if transpose_a
  std::size_t lda = 0;   // >= k, or >= m if transpose_a
  bool transpose_a = false;
  const T* b = nullptr;  // [k,n], or [n,k] if transpose_b
  std::size_t ldb = 0;   // >= n, or >= k if transpose_b
  bool transpose_b = false;
  T* c = nullptr;  // [m,n]
  std::size_t ldc = 0;
  const T* bias = nullptr;  // [n], added to every row; none if null
  bool accumulate = false;  // adds to C instead of overwriting it
};

void Gemm(const GemmProblem<float>& problem, const KernelContext& context);

}  // namespace tilegrad::nn

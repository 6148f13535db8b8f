// SPDX-License-Identifier: Apache-2.0
// Scalar reference of gemm.h. T: float, double or std::complex<double>.
#pragma once

#include "nn/kernels/gemm.h"

namespace tilegrad::nn {

// op(M)[row, column] of a row-major matrix.
template <class T>
T ElementOf(const T* matrix, std::size_t ld, bool transposed, std::size_t row, std::size_t column) {
  return transposed ? matrix[column * ld + row] : matrix[row * ld + column];
}

// Dot products in order of k, bias and old C added last.
template <class T>
void GemmRef(const GemmProblem<T>& p) {
  for (std::size_t i = 0; i < p.m; ++i) {
    for (std::size_t j = 0; j < p.n; ++j) {
      T sum{};
      for (std::size_t l = 0; l < p.k; ++l) {
        sum +=
            ElementOf(p.a, p.lda, p.transpose_a, i, l) * ElementOf(p.b, p.ldb, p.transpose_b, l, j);
      }
      if (p.bias != nullptr) sum += p.bias[j];
      T& c = p.c[i * p.ldc + j];
      c = p.accumulate ? c + sum : sum;
    }
  }
}

}  // namespace tilegrad::nn

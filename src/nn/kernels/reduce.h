// SPDX-License-Identifier: Apache-2.0
// Sums and extrema over axes. Bits depend on the shape and the SIMD target, never on the number of
// workers: one worker sums each output in an order that depends on the shape only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.h"

namespace tilegrad::nn {

// x viewed as [k0, r0, k1, r1, k2, r2] (row-major): kept and reduced axes alternate, with extent 1
// for absent ones. y is [k0, k1, k2].
struct ReduceLayout {
  std::array<std::size_t, 3> kept = {1, 1, 1};
  std::array<std::size_t, 3> reduced = {1, 1, 1};

  std::size_t outputs() const { return kept[0] * kept[1] * kept[2]; }
  std::size_t inputs_each() const { return reduced[0] * reduced[1] * reduced[2]; }
};

// y = sum of x over the reduced axes; 0 for an empty sum.
void ReduceSum(const ReduceLayout& layout, const float* x, float* y, const Workers& workers);
void ReduceSum(const ReduceLayout& layout, const double* x, double* y, const Workers& workers);

// y = x[first], first = the flat index (into x) of the first element that attains the maximum of
// sign * x; sign is 1 or -1. NaN counts as larger than everything. inputs_each() > 0.
struct ArgExtremum {
  int sign = 1;
  std::int32_t* first = nullptr;  // [k0, k1, k2]
};
template <class T>  // float or double
void ReduceExtremum(const ReduceLayout& layout, const T* x, T* y, const ArgExtremum& arg,
                    const Workers& workers);

}  // namespace tilegrad::nn

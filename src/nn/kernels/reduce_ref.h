// SPDX-License-Identifier: Apache-2.0
// Scalar reference of reduce.h. T: float, double or std::complex<double> (sums only).
#pragma once

#include "nn/kernels/reduce.h"

namespace tilegrad::nn {

// Addresses of the elements of output `o`: x[base + i0 steps[0] + i1 steps[1] + i2], i < reduced.
struct ReduceAddress {
  std::size_t base;
  std::array<std::size_t, 2> steps;
};

inline ReduceAddress AddressOf(const ReduceLayout& l, std::size_t o) {
  const std::size_t i2 = o % l.kept[2], rest = o / l.kept[2];
  const std::size_t i1 = rest % l.kept[1], i0 = rest / l.kept[1];
  const std::size_t step1 = l.kept[2] * l.reduced[2];          // along r1
  const std::size_t step0 = l.kept[1] * l.reduced[1] * step1;  // along r0
  return {i0 * l.reduced[0] * step0 + i1 * l.reduced[1] * step1 + i2 * l.reduced[2],
          {step0, step1}};
}

// Calls visit(flat index into x) for the elements of output `o`, in memory order.
template <class Visit>
void ForEachReduced(const ReduceLayout& l, std::size_t o, const Visit& visit) {
  const ReduceAddress address = AddressOf(l, o);
  for (std::size_t a = 0; a < l.reduced[0]; ++a) {
    for (std::size_t b = 0; b < l.reduced[1]; ++b) {
      const std::size_t row = address.base + a * address.steps[0] + b * address.steps[1];
      for (std::size_t c = 0; c < l.reduced[2]; ++c) visit(row + c);
    }
  }
}

template <class T>
void ReduceSumRef(const ReduceLayout& l, const T* x, T* y, std::size_t begin, std::size_t end) {
  for (std::size_t o = begin; o < end; ++o) {
    T sum{};
    ForEachReduced(l, o, [&](std::size_t i) { sum += x[i]; });
    y[o] = sum;
  }
}

template <class T>
void ReduceExtremumRef(const ReduceLayout& l, const T* x, T* y, const ArgExtremum& arg,
                       std::size_t o) {
  std::size_t best = AddressOf(l, o).base;
  const T sign = static_cast<T>(arg.sign);
  ForEachReduced(l, o, [&](std::size_t i) {
    const bool better = sign * x[i] > sign * x[best] || (x[i] != x[i] && x[best] == x[best]);
    if (better) best = i;
  });
  y[o] = x[best];
  arg.first[o] = static_cast<std::int32_t>(best);
}

}  // namespace tilegrad::nn

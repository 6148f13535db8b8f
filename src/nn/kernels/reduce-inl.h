// SPDX-License-Identifier: Apache-2.0
// Vector body of reduce.h. If the last axis is reduced, lanes run along it; if it is kept, each
// lane sums its own output.

#include <hwy/highway.h>

#include "nn/kernels/reduce_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Outputs [begin, end); the last axis is reduced.
void SumAlongRows(const ReduceLayout& l, const float* x, float* y, std::size_t begin,
                  std::size_t end) {
  for (std::size_t o = begin; o < end; ++o) {
    const ReduceAddress address = AddressOf(l, o);
    RowSum sum{DF()};
    for (std::size_t a = 0; a < l.reduced[0]; ++a) {
      for (std::size_t b = 0; b < l.reduced[1]; ++b) {
        sum.AddRow(x + address.base + a * address.steps[0] + b * address.steps[1], l.reduced[2]);
      }
    }
    y[o] = sum.Total();
  }
}

// Outputs [begin, end), which share k0 and k1; the last axis is kept: r2 = 1.
void SumColumns(const ReduceLayout& l, const float* x, float* y, std::size_t begin,
                std::size_t end) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t o = begin; o < end; o += lanes) {
    const ReduceAddress address = AddressOf(l, o);
    const std::size_t count = HWY_MIN(lanes, end - o);
    VF sum = hn::Zero(d);
    for (std::size_t a = 0; a < l.reduced[0]; ++a) {
      for (std::size_t b = 0; b < l.reduced[1]; ++b) {
        const float* from = x + address.base + a * address.steps[0] + b * address.steps[1];
        sum = hn::Add(sum, LoadSome(d, from, count));
      }
    }
    StoreSome(sum, d, y + o, count);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

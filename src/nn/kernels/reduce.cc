// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/reduce.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/reduce.cc"
#include <hwy/foreach_target.h>
//
#include "base/scalar.h"
#include "nn/kernels/reduce-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "nn/kernels/panels.h"

namespace tilegrad::nn {

HWY_EXPORT(SumAlongRows);
HWY_EXPORT(SumColumns);

namespace {

constexpr std::size_t kGrain = 16384;       // elements read by a task, about
constexpr std::size_t kColumnBlock = 256;   // outputs of one task where columns are summed
constexpr std::size_t kMaxPartials = 4096;  // of one long sum, merged in order

std::size_t OutputsPerTask(const ReduceLayout& l, const Workers& workers) {
  const std::size_t inputs = std::max<std::size_t>(1, l.inputs_each());
  return std::max<std::size_t>(1, GrainFor(l.outputs() * inputs, kGrain, workers) / inputs);
}

// One long row: partial sums of fixed stretches, then their sum.
void SumOne(const float* x, std::size_t n, float* y, const Workers& workers) {
  const std::size_t stretch = std::max(kGrain, (n + kMaxPartials - 1) / kMaxPartials);
  const std::size_t parts = (n + stretch - 1) / stretch;
  std::array<float, kMaxPartials> partial;
  workers.For(parts, [&](std::size_t i) {
    ReduceLayout row;
    row.reduced[2] = std::min(stretch, n - i * stretch);
    HWY_DYNAMIC_DISPATCH(SumAlongRows)(row, x + i * stretch, &partial[i], 0, 1);
  });
  double sum = 0;
  for (std::size_t i = 0; i < parts; ++i) sum += static_cast<double>(partial[i]);
  *y = static_cast<float>(sum);
}

// The same reduction with its innermost axes in the last places, so that rows are as long as they
// can be.
ReduceLayout ShiftedInward(ReduceLayout l) {
  for (int place = 0; place < 2 && l.kept[2] == 1 && l.reduced[2] == 1; ++place) {
    l.kept = {1, l.kept[0], l.kept[1]};
    l.reduced = {1, l.reduced[0], l.reduced[1]};
  }
  return l;
}

}  // namespace

void ReduceSum(const ReduceLayout& layout, const float* x, float* y, const Workers& workers) {
  const ReduceLayout l = ShiftedInward(layout);
  if (l.outputs() == 1 && l.reduced[0] == 1 && l.reduced[1] == 1) {
    return SumOne(x, l.reduced[2], y, workers);
  }
  if (l.reduced[2] != 1 || l.kept[2] == 1) {
    workers.ForRanges(l.outputs(), OutputsPerTask(l, workers),
                      [&](std::size_t begin, std::size_t end) {
                        HWY_DYNAMIC_DISPATCH(SumAlongRows)(l, x, y, begin, end);
                      });
    return;
  }
  const std::size_t columns = l.kept[2], grain = GrainFor(l.outputs(), kColumnBlock, workers);
  const std::size_t blocks = (columns + grain - 1) / grain;
  workers.For(l.kept[0] * l.kept[1] * blocks, [&](std::size_t task) {
    const std::size_t row = task / blocks * columns, block = task % blocks * grain;
    const std::size_t end = row + std::min(columns, block + grain);
    HWY_DYNAMIC_DISPATCH(SumColumns)(l, x, y, row + block, end);
  });
}

void ReduceSum(const ReduceLayout& l, const double* x, double* y, const Workers& workers) {
  workers.ForRanges(l.outputs(), OutputsPerTask(l, workers),
                    [&](std::size_t begin, std::size_t end) { ReduceSumRef(l, x, y, begin, end); });
}

// Scalar in both types: the position of the first one has to be known, and what is reduced this way
// (bounding boxes, logits) is small.
template <class T>
void ReduceExtremum(const ReduceLayout& l, const T* x, T* y, const ArgExtremum& arg,
                    const Workers& workers) {
  workers.ForEach(l.outputs(), OutputsPerTask(l, workers),
                  [&](std::size_t o) { ReduceExtremumRef(l, x, y, arg, o); });
}
TILEGRAD_INSTANTIATE(ReduceExtremum);

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

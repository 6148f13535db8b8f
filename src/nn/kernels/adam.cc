// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/adam.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/adam.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/adam-inl.h"

#if HWY_ONCE
#include <algorithm>
#include <array>

namespace tilegrad::nn {

HWY_EXPORT(AdamRange);
HWY_EXPORT(SquaresRange);

namespace {

constexpr std::size_t kGrain = 65536;       // elements to a task
constexpr std::size_t kMaxPartials = 4096;  // of one sum

template <class T, class RangeSum>
double SumByRanges(const T* x, std::size_t n, const Workers& workers, const RangeSum& range_sum) {
  const std::size_t stretch = std::max(kGrain, (n + kMaxPartials - 1) / kMaxPartials);
  std::array<double, kMaxPartials> partial;
  workers.NoteTraffic(static_cast<double>(n * sizeof(T)));
  workers.ForRanges(n, stretch, [&](std::size_t begin, std::size_t end, std::size_t) {
    partial[begin / stretch] = range_sum(x + begin, end - begin);
  });
  double sum = 0;
  for (std::size_t i = 0; i * stretch < n; ++i) sum += partial[i];
  return sum;
}

}  // namespace

void AdamStep(const AdamProblem<float>& problem, const Workers& workers) {
  workers.NoteTraffic(static_cast<double>(problem.n * 7 * sizeof(float)));
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    HWY_DYNAMIC_DISPATCH(AdamRange)(problem, begin, end);
  });
}

void AdamStep(const AdamProblem<double>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    AdamStepRef(problem, begin, end);
  });
}

double SumOfSquares(const float* x, std::size_t n, const Workers& workers) {
  return SumByRanges(x, n, workers, [](const float* from, std::size_t count) {
    return HWY_DYNAMIC_DISPATCH(SquaresRange)(from, count);
  });
}

double SumOfSquares(const double* x, std::size_t n, const Workers& workers) {
  return SumByRanges(x, n, workers, SumOfSquaresRef<double>);
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/adam.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/adam.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/adam-inl.h"

#if HWY_ONCE
#include <algorithm>

namespace tilegrad::nn {

HWY_EXPORT(AdamRange);
HWY_EXPORT(SquaresRange);

namespace {

constexpr std::size_t kGrain = 65536;       // elements to a task
constexpr std::size_t kMaxPartials = 4096;  // of one sum

std::size_t StretchOf(std::size_t n) {
  return std::max(kGrain, (n + kMaxPartials - 1) / kMaxPartials);
}

// A stretch of an array, and the sum over it.
template <class T>
struct Stretch {
  std::size_t array = 0;
  std::span<const T> x = {};
  double sum = 0;
};

template <class T, class RangeSum>
std::vector<double> SumsByStretches(std::span<const std::span<const T>> arrays,
                                    const Workers& workers, const RangeSum& range_sum) {
  std::vector<Stretch<T>> stretches;
  double bytes = 0;
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const std::size_t n = arrays[i].size(), stretch = StretchOf(n);
    for (std::size_t begin = 0; begin < n; begin += stretch)
      stretches.push_back({i, arrays[i].subspan(begin, std::min(stretch, n - begin))});
    bytes += static_cast<double>(n * sizeof(T));
  }
  workers.NoteTraffic(bytes);
  workers.For(stretches.size(), [&](std::size_t i) {
    stretches[i].sum = range_sum(stretches[i].x.data(), stretches[i].x.size());
  });
  std::vector<double> sums(arrays.size());
  for (const Stretch<T>& stretch : stretches) sums[stretch.array] += stretch.sum;
  return sums;
}

}  // namespace

void AdamStep(const AdamProblem<float>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end) {
    HWY_DYNAMIC_DISPATCH(AdamRange)(problem, begin, end);
  });
}

void AdamStep(const AdamProblem<double>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain,
                    [&](std::size_t begin, std::size_t end) { AdamStepRef(problem, begin, end); });
}

std::vector<double> SumsOfSquares(std::span<const std::span<const float>> arrays,
                                  const Workers& workers) {
  return SumsByStretches(arrays, workers, [](const float* from, std::size_t count) {
    return HWY_DYNAMIC_DISPATCH(SquaresRange)(from, count);
  });
}

std::vector<double> SumsOfSquares(std::span<const std::span<const double>> arrays,
                                  const Workers& workers) {
  return SumsByStretches(arrays, workers, SumOfSquaresRef<double>);
}

double SumOfSquares(const float* x, std::size_t n, const Workers& workers) {
  const std::span<const float> array(x, n);
  return SumsOfSquares({&array, 1}, workers)[0];
}

double SumOfSquares(const double* x, std::size_t n, const Workers& workers) {
  const std::span<const double> array(x, n);
  return SumsOfSquares({&array, 1}, workers)[0];
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

// SPDX-License-Identifier: Apache-2.0
// The yardsticks of the NN benchmarks: what one core reaches at best, and whether it is ours alone,
// measured beside each kernel; and the medians of runs that take turns.
#pragma once

#include <time.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tilegrad::nn {

// Runs independent fused multiply-adds (multiply and add where the target has none) from registers
// for about a millisecond; returns their floating-point operations, 2 each.
double RunFmaPeak();

// As many instructions a cycle as the core takes, a third of them fused multiply-adds and the rest
// integer additions, all from registers, for a third of a millisecond; returns the floating-point
// operations. A second hardware thread on the core takes a share of these instructions, and nothing
// else does; RunFmaPeak, with little more than two a cycle, leaves room for it and does not tell.
double RunFullCore();

// CPU time of this thread in seconds: others on the machine disturb it less than wall time.
inline double ThreadSeconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

inline double WallSeconds() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Samples of one contender's rate; the median is robust to a busy machine.
class Samples {
 public:
  void Add(double value) { values_.push_back(value); }
  std::size_t size() const { return values_.size(); }
  double Median() const { return Quantile(0.5); }
  double Quantile(double share) const {
    if (values_.empty()) return 0;
    std::vector<double> sorted = values_;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(share * sorted.size());
    std::nth_element(sorted.begin(), at, sorted.end());
    return *at;
  }

 private:
  std::vector<double> values_;
};

// FLOP/s of `run`, which does `flop` operations, by `clock`.
template <class Clock, class F>
double Rate(const Clock& clock, double flop, const F& run) {
  const double start = clock();
  run();
  return flop / (clock() - start);
}

// FLOP/s of a yardstick, by CPU time.
inline double RateOf(double (*yardstick)()) {
  const double start = ThreadSeconds();
  const double flop = yardstick();
  return flop / (ThreadSeconds() - start);
}

}  // namespace tilegrad::nn

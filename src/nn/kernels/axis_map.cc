// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/axis_map.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/axis_map.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/axis_map-inl.h"

#if HWY_ONCE
#include <algorithm>

namespace tilegrad::nn {

HWY_EXPORT(AxisMapRange);

namespace {

constexpr std::size_t kGrain = 16384;  // elements of y to a task

template <class T, class Run>
void ForRows(const AxisMapProblem<T>& p, const Workers& workers, const Run& run) {
  const std::size_t rows = std::max<std::size_t>(1, kGrain / std::max<std::size_t>(1, p.inner));
  workers.ForRanges(p.outer * p.out, rows,
                    [&](std::size_t begin, std::size_t end, std::size_t) { run(begin, end); });
}

}  // namespace

void MapAxis(const AxisMapProblem<float>& problem, const Workers& workers) {
  ForRows(problem, workers, [&](std::size_t begin, std::size_t end) {
    HWY_DYNAMIC_DISPATCH(AxisMapRange)(problem, begin, end);
  });
}

void MapAxis(const AxisMapProblem<double>& problem, const Workers& workers) {
  ForRows(problem, workers,
          [&](std::size_t begin, std::size_t end) { AxisMapRef(problem, begin, end); });
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

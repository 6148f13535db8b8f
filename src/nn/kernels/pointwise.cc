// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/pointwise.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/pointwise.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/pointwise-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "nn/kernels/panels.h"

namespace tilegrad::nn {

HWY_EXPORT(UnaryRange);
HWY_EXPORT(BinaryRange);

namespace {

constexpr std::size_t kGrain = 16384;  // elements to a task: 64 KiB of output

// Calls run(RowRange) over ranges that together are all of the problem.
template <class T, class Run>
void ForRowRanges(const BinaryProblem<T>& problem, const Workers& workers, const Run& run) {
  const std::size_t length = problem.extents.back();
  std::size_t rows = 1;
  for (std::size_t i = 0; i + 1 < problem.extents.size(); ++i) rows *= problem.extents[i];
  const std::size_t elements = GrainFor(rows * length, kGrain, workers);
  if (rows == 1) {
    workers.ForRanges(length, elements, [&](std::size_t begin, std::size_t end) {
      run(RowRange{0, 1, begin, end});
    });
    return;
  }
  const std::size_t grain = std::max<std::size_t>(1, elements / std::max<std::size_t>(1, length));
  workers.ForRanges(rows, grain, [&](std::size_t first, std::size_t last) {
    run(RowRange{first, last, 0, length});
  });
}

}  // namespace

void Unary(const UnaryProblem<float>& problem, const Workers& workers) {
  workers.NoteTraffic(static_cast<double>(problem.n * 2 * sizeof(float)));
  const std::size_t grain = GrainFor(problem.n, kGrain, workers);
  workers.ForRanges(problem.n, grain, [&](std::size_t begin, std::size_t end) {
    HWY_DYNAMIC_DISPATCH(UnaryRange)(problem, begin, end);
  });
}

void Unary(const UnaryProblem<double>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end) {
    UnaryRangeRef(problem, begin, end);
  });
}

void Binary(const BinaryProblem<float>& problem, const Workers& workers) {
  ForRowRanges(problem, workers, [&](const RowRange& range) {
    HWY_DYNAMIC_DISPATCH(BinaryRange)(problem, range);
  });
}

void Binary(const BinaryProblem<double>& problem, const Workers& workers) {
  ForRowRanges(problem, workers, [&](const RowRange& range) { BinaryRangeRef(problem, range); });
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

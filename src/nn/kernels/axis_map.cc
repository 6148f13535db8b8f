// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/axis_map.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/axis_map.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/axis_map-inl.h"

#if HWY_ONCE
#include <algorithm>
#include <vector>

#include "base/inline_vector.h"
#include "nn/kernels/panels.h"

namespace tilegrad::nn {

HWY_EXPORT(AxisMapRange);
HWY_EXPORT(ImageMapRange);
HWY_EXPORT(LastAxisRange);

namespace {

constexpr std::size_t kGrain = 16384;  // terms to a task

// Of all rows, which have so many terms together.
std::size_t RowsPerTask(std::size_t rows, std::size_t terms, const Workers& workers) {
  const std::size_t row = std::max<std::size_t>(1, DivideUp(terms, std::max<std::size_t>(1, rows)));
  return std::max<std::size_t>(1, GrainFor(terms, kGrain, workers) / row);
}

template <class T, class Run>
void ForRows(const AxisMapProblem<T>& p, const Workers& workers, const Run& run) {
  const std::size_t rows = p.outer * p.map.out;
  const auto terms = p.outer * p.inner * static_cast<std::size_t>(p.map.begin[p.map.out]);
  workers.ForRanges(rows, RowsPerTask(rows, terms, workers), run);
}

// Fewer copies are not worth a run of their own.
constexpr std::size_t kLeastCopies = 8;

std::size_t TermsOf(const SparseRows<float>& columns, std::size_t j) {
  return static_cast<std::size_t>(columns.begin[j + 1] - columns.begin[j]);
}

// The end of the columns from j on that copy neighbours, as far as `limit`.
std::size_t CopiesEnd(const SparseRows<float>& columns, std::size_t j, std::size_t limit) {
  const std::int32_t* const first = columns.index + columns.begin[j];
  std::size_t end = j;
  for (; end < limit && TermsOf(columns, end) == 1; ++end) {
    const std::int32_t t = columns.begin[end];
    if (columns.weight[t] != 1.0f || columns.index[t] != *first + static_cast<int>(end - j)) break;
  }
  return end;
}

bool BeginsCopies(const SparseRows<float>& columns, std::size_t j) {
  return CopiesEnd(columns, j, std::min(columns.out, j + kLeastCopies)) == j + kLeastCopies;
}

ColumnRun RunFrom(const SparseRows<float>& columns, std::size_t j) {
  if (BeginsCopies(columns, j)) return {j, CopiesEnd(columns, j, columns.out), 1, true};
  const std::size_t terms = TermsOf(columns, j);
  std::size_t end = j + 1;
  while (end < columns.out && TermsOf(columns, end) == terms && !BeginsCopies(columns, end)) ++end;
  return {j, end, terms, false};
}

using ColumnRuns = InlineVector<ColumnRun, 16>;  // padding and resizing need five

ColumnRuns FindRuns(const SparseRows<float>& columns) {
  ColumnRuns runs;
  for (std::size_t j = 0; j < columns.out; j = runs.back().end) runs.push_back(RunFrom(columns, j));
  return runs;
}

// Calls run(first, last, worker) over all rows of y.
template <class T, class Run>
void ForImageRows(const ImageMapProblem<T>& p, const Workers& workers, const Run& run) {
  const std::size_t rows = p.outer * p.rows.out;
  workers.ForRanges(rows, RowsPerTask(rows, rows * p.columns.out, workers), run);
}

}  // namespace

void MapAxis(const AxisMapProblem<float>& problem, const Workers& workers) {
  if (problem.inner > 1) {
    ForRows(problem, workers, [&](std::size_t begin, std::size_t end) {
      HWY_DYNAMIC_DISPATCH(AxisMapRange)(problem, begin, end);
    });
    return;
  }
  const ColumnRuns runs = FindRuns(problem.map);
  workers.ForRanges(problem.outer,
                    RowsPerTask(problem.outer, problem.outer * problem.map.out, workers),
                    [&](std::size_t begin, std::size_t end) {
                      HWY_DYNAMIC_DISPATCH(LastAxisRange)
                      (problem, {runs.data(), runs.size()}, begin, end);
                    });
}

void MapAxis(const AxisMapProblem<double>& problem, const Workers& workers) {
  ForRows(problem, workers,
          [&](std::size_t begin, std::size_t end) { AxisMapRef(problem, begin, end); });
}

void MapImage(const ImageMapProblem<float>& problem, const KernelContext& context) {
  const std::size_t pitch = RoundUp(problem.columns.in, kAlignment);
  float* const combined = context.scratch.Floats(pitch * context.workers.size());
  const ColumnRuns runs = FindRuns(problem.columns);
  ForImageRows(problem, context.workers,
               [&](std::size_t first, std::size_t last, std::size_t worker) {
                 HWY_DYNAMIC_DISPATCH(ImageMapRange)
                 (problem, {runs.data(), runs.size()}, first, last, combined + worker * pitch);
               });
}

void MapImage(const ImageMapProblem<double>& problem, const KernelContext& context) {
  const std::size_t pitch = problem.columns.in;
  std::vector<double> combined(pitch * context.workers.size());
  ForImageRows(problem, context.workers,
               [&](std::size_t first, std::size_t last, std::size_t worker) {
                 for (std::size_t row = first; row < last; ++row)
                   ImageMapRowRef(problem, row, &combined[worker * pitch]);
               });
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE

// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/adam.h"

#include <vector>

#include "nn/kernels/adam_ref.h"

namespace tilegrad::nn {
namespace {

constexpr std::size_t kGrain = 65536;  // elements to a task

template <class T>
double Sum(const T* x, std::size_t n, const Workers& workers) {
  std::vector<double> partial((n + kGrain - 1) / kGrain);
  workers.ForRanges(n, kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    partial[begin / kGrain] = SumOfSquaresRef(x + begin, end - begin);
  });
  double sum = 0;
  for (double p : partial) sum += p;
  return sum;
}

}  // namespace

void AdamStep(const AdamProblem<float>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    AdamStepRef(problem, begin, end);
  });
}

void AdamStep(const AdamProblem<double>& problem, const Workers& workers) {
  workers.ForRanges(problem.n, kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    AdamStepRef(problem, begin, end);
  });
}

double SumOfSquares(const float* x, std::size_t n, const Workers& workers) {
  return Sum(x, n, workers);
}

double SumOfSquares(const double* x, std::size_t n, const Workers& workers) {
  return Sum(x, n, workers);
}

}  // namespace tilegrad::nn

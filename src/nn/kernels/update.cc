// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/update.h"

namespace tilegrad::nn {
namespace {

constexpr std::size_t kUpdateGrain = 65536;  // elements to a task

}  // namespace

template <class T>
void SgdStep(const SgdProblem<T>& problem, const Workers& workers) {
  const SgdCoefficients& c = problem.coefficients;
  const auto rate = static_cast<T>(c.rate), momentum = static_cast<T>(c.momentum);
  const auto scale = static_cast<T>(c.gradient_scale), decay = static_cast<T>(c.weight_decay);
  // p - rate (ahead g + along v)
  const auto ahead = static_cast<T>(c.nesterov ? 1 : 0);
  const T along = c.nesterov ? momentum : T(1);
  workers.ForRanges(problem.n, kUpdateGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      const T g = scale * problem.gradient[i] + decay * problem.parameter[i];
      problem.v[i] = momentum * problem.v[i] + g;
      problem.parameter[i] -= rate * (ahead * g + along * problem.v[i]);
    }
  });
}

template <class T>
void Blend(const BlendShape& shape, const T* x, T* y, const Workers& workers) {
  const auto decay = static_cast<T>(shape.decay), rest = static_cast<T>(1 - shape.decay);
  workers.ForRanges(shape.n, kUpdateGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) y[i] = decay * y[i] + rest * x[i];
  });
}

template void SgdStep(const SgdProblem<float>&, const Workers&);
template void SgdStep(const SgdProblem<double>&, const Workers&);
template void Blend(const BlendShape&, const float*, float*, const Workers&);
template void Blend(const BlendShape&, const double*, double*, const Workers&);

}  // namespace tilegrad::nn

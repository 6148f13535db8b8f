// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/update.h"

namespace tilegrad::nn {
namespace {

constexpr std::size_t kUpdateGrain = 65536;  // elements to a task

}  // namespace

template <class T>
void Blend(const BlendShape& shape, const T* x, T* y, const Workers& workers) {
  const auto decay = static_cast<T>(shape.decay), rest = static_cast<T>(1 - shape.decay);
  workers.ForRanges(shape.n, kUpdateGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) y[i] = decay * y[i] + rest * x[i];
  });
}

template void Blend(const BlendShape&, const float*, float*, const Workers&);
template void Blend(const BlendShape&, const double*, double*, const Workers&);

}  // namespace tilegrad::nn

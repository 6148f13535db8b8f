// SPDX-License-Identifier: Apache-2.0
#include "nn/init.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::nn {
namespace {

template <class Draw>
void FillBy(Tensor& tensor, const Draw& draw) {
  WithFloatType(tensor.dtype(), [&]<class T>(T) {
    std::generate_n(tensor.data<T>(), tensor.elements(), [&] { return static_cast<T>(draw()); });
  });
}

}  // namespace

void FillConstant(Tensor& tensor, double value) {
  FillBy(tensor, [value] { return value; });
}

void FillNormal(Tensor& tensor, Rng& rng, double deviation) {
  FillBy(tensor, [&] { return deviation * rng.Normal(); });
}

void FillUniform(Tensor& tensor, Rng& rng, double low, double high) {
  FillBy(tensor, [&] { return rng.Uniform(low, high); });
}

void FillDefault(Tensor& tensor, Rng& rng, std::int64_t fan_in) {
  const double bound = 1.0 / std::sqrt(static_cast<double>(std::max<std::int64_t>(1, fan_in)));
  FillUniform(tensor, rng, -bound, bound);
}

}  // namespace tilegrad::nn

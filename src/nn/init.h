// SPDX-License-Identifier: Apache-2.0
// Initial values of parameters. The stream of random numbers is the caller's, so equal seeds
// give equal networks for any number of workers.
#pragma once

#include "base/rng.h"
#include "nn/tensor.h"

namespace tilegrad::nn {

void FillConstant(Tensor& tensor, double value);
void FillNormal(Tensor& tensor, Rng& rng, double deviation);          // N(0, deviation^2)
void FillUniform(Tensor& tensor, Rng& rng, double low, double high);  // [low, high)

// What PyTorch gives to linear and convolution weights and to their biases by default: uniform in
// +-1/sqrt(fan_in) (He et al. 2015 with a = sqrt 5).
void FillDefault(Tensor& tensor, Rng& rng, std::int64_t fan_in);

}  // namespace tilegrad::nn

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

// Inputs that one output of a weight [out, in] or [out, in, kh, kw] sums over.
std::int64_t FanIn(const Shape& weight);

std::int64_t FanOut(const Shape& weight);  // outputs that one input goes to

// He et al. 2015: N(0, 2 / ((1 + slope^2) fan_in)), for layers followed by (leaky) ReLU.
void FillHe(Tensor& weight, Rng& rng, double slope = 0.0);
// Glorot, Bengio 2010: uniform of variance 2 / (fan_in + fan_out), for tanh and linear layers.
void FillGlorot(Tensor& weight, Rng& rng);

// What PyTorch gives to linear and convolution weights and to their biases by default: uniform in
// +-1/sqrt(fan_in) (He et al. 2015 with a = sqrt 5).
void FillDefault(Tensor& tensor, Rng& rng, std::int64_t fan_in);

}  // namespace tilegrad::nn

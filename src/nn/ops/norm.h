// SPDX-License-Identifier: Apache-2.0
// Normalisation within one sample, and of weights. Each of the first three is batch normalisation
// of a reshaped input (ops/batch_norm.h), and so has its kernel and its rule.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

struct NormOptions {
  double epsilon = 1e-5;  // added to the variance
};

// x [n, c, h, w], gamma and beta [c]; statistics over each image of each channel, h w >= 2 elements
// (Ulyanov et al. 2016).
Var InstanceNorm(const Var& x, const Var& gamma, const Var& beta, const NormOptions& options = {});

// x [n, c, h, w] or [n, c]; statistics over c / groups channels of each sample, which must have at
// least two elements (Wu, He 2018).
Var GroupNorm(const Var& x, int groups, const Var& gamma, const Var& beta,
              const NormOptions& options = {});

// Statistics over the last axes, those of gamma's shape, of at least two elements: x [.., gamma's
// shape], beta as gamma (Ba et al. 2016).
Var LayerNorm(const Var& x, const Var& gamma, const Var& beta, const NormOptions& options = {});

// Of W = a weight as [out, rest]: u [out] and v [rest], each of length 1.
struct SpectralVectors {
  Tensor u, v;
};

// weight / sigma, sigma = u^T W v: the largest singular value where u and v are its singular
// vectors (Miyato et al. 2018). They are constant, as in torch.nn.utils.spectral_norm.
Var SpectralNorm(const Var& weight, const SpectralVectors& at);
// One power iteration (algorithm 1): v = W^T u, then u = W v, each of length 1. Repeated, it turns
// them into those vectors.
void SpectralStep(const Var& weight, SpectralVectors& at);
// The first half of it: v = W^T u, of length 1; u stays.
void SpectralRightVector(const Var& weight, SpectralVectors& at);

}  // namespace tilegrad::nn

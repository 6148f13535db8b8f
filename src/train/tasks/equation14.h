// SPDX-License-Identifier: Apache-2.0
// The terms of equation 14 that tasks share.
#pragma once

#include "train/losses/loss_sum.h"

namespace tilegrad::train {

// alpha and truth: [N, size, size].
void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum);
// `loss`: of colours, however they are compared.
void AddColor(double weight, const nn::Var& loss, LossSum* sum);

}  // namespace tilegrad::train

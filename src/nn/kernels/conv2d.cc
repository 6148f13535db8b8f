// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/conv2d.h"

#include "nn/kernels/conv2d_ref.h"

namespace tilegrad::nn {

void Conv2dForward(const Conv2dShape& shape, const float* x, const float* weight, const float* bias,
                   float* y, const KernelContext&) {
  Conv2dForwardRef(shape, x, weight, bias, y);
}

void Conv2dInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                     const KernelContext&) {
  Conv2dInputGradRef(shape, d_y, weight, d_x);
}

void Conv2dWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                      const KernelContext&) {
  Conv2dWeightGradRef(shape, x, d_y, d_weight);
}

}  // namespace tilegrad::nn

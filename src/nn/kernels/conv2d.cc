// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/conv2d.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/conv2d.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/conv2d-inl.h"
#include "nn/kernels/conv2d_weight_grad-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "nn/kernels/conv2d_winograd.h"

namespace tilegrad::nn {
HWY_EXPORT(Conv2dForwardTarget);
HWY_EXPORT(Conv2dInputGradTarget);
HWY_EXPORT(Conv2dWeightGradTarget);

void Conv2dForward(const Conv2dShape& shape, const float* x, const float* weight, const float* bias,
                   float* y, const KernelContext& context) {
  if (context.winograd && WinogradFits(shape)) {
    return WinogradForward(shape, x, weight, bias, y, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dForwardTarget)(shape, x, weight, bias, y, context);
}

void Conv2dInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                     const KernelContext& context) {
  if (context.winograd && WinogradFits(shape)) {
    return WinogradInputGrad(shape, d_y, weight, d_x, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dInputGradTarget)(shape, d_y, weight, d_x, context);
}

void Conv2dWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                      const KernelContext& context) {
  if (shape.batch == 0) {
    std::fill_n(d_weight, shape.weight_size(), 0.0f);
    return;
  }
  if (context.winograd && WinogradFits(shape)) {
    return WinogradWeightGrad(shape, x, d_y, d_weight, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dWeightGradTarget)(shape, x, d_y, d_weight, context);
}

}  // namespace tilegrad::nn
#endif

// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/conv2d/winograd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/conv2d/winograd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/conv2d/winograd-inl.h"

#if HWY_ONCE

namespace tilegrad::nn {
HWY_EXPORT(WinogradForwardTarget);
HWY_EXPORT(WinogradInputGradTarget);
HWY_EXPORT(WinogradWeightGradTarget);

bool WinogradFits(const Conv2dShape& s) {
  const std::size_t kernel = s.kernel_height;
  const bool known = (kernel == 3 && s.stride == 1 && s.padding < kernel) ||
                     (kernel == 4 && s.stride == 2) || (kernel == 5 && s.stride == 2);
  // Tiles of 2 x 2 must not hang over the edge by too much.
  return known && kernel == s.kernel_width && s.batch > 0 &&
         s.in_channels >= kLeastWinogradChannels && s.out_channels >= kLeastWinogradChannels &&
         s.out_height() >= 3 && s.out_width() >= 3;
}

void WinogradForward(const Conv2dShape& shape, const float* x, const float* weight,
                     const float* bias, float* y, const KernelContext& context) {
  HWY_DYNAMIC_DISPATCH(WinogradForwardTarget)(shape, x, weight, bias, y, context);
}

void WinogradInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                       const KernelContext& context) {
  HWY_DYNAMIC_DISPATCH(WinogradInputGradTarget)(shape, d_y, weight, d_x, context);
}

void WinogradWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                        const KernelContext& context) {
  HWY_DYNAMIC_DISPATCH(WinogradWeightGradTarget)(shape, x, d_y, d_weight, context);
}

}  // namespace tilegrad::nn
#endif

// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/product_adam.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/product_adam.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/product_adam-inl.h"

#if HWY_ONCE
namespace tilegrad::nn {
HWY_EXPORT(ProductAdamTarget);

void ProductAdamStep(const GemmProblem<float>& product, const AdamProblem<float>& adam,
                     const KernelContext& context) {
  if (product.m == 0 || product.n == 0) return;
  HWY_DYNAMIC_DISPATCH(ProductAdamTarget)(product, adam, context);
}

}  // namespace tilegrad::nn
#endif

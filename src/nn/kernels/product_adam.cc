// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/product_adam.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/product_adam.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/product_adam-inl.h"

#if HWY_ONCE
namespace tilegrad::nn {
HWY_EXPORT(ProductAdamsTarget);

void ProductAdamSteps(std::span<const ProductAdamProblem> problems, const KernelContext& context) {
  if (!problems.empty()) HWY_DYNAMIC_DISPATCH(ProductAdamsTarget)(problems, context);
}

}  // namespace tilegrad::nn
#endif

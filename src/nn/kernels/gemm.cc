// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/gemm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/gemm.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/gemm-inl.h"

#if HWY_ONCE
#include "nn/kernels/gemm_ref.h"

namespace tilegrad::nn {
HWY_EXPORT(GemmTarget);

void Gemm(const GemmProblem<float>& problem, const KernelContext& context) {
  if (problem.m == 0 || problem.n == 0) return;
  if (problem.k == 0) return GemmRef(problem);  // nothing to multiply: only C and bias
  HWY_DYNAMIC_DISPATCH(GemmTarget)(problem, context);
}

}  // namespace tilegrad::nn
#endif

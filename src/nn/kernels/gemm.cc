// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/gemm.h"

#include "nn/kernels/gemm_ref.h"

namespace tilegrad::nn {

void Gemm(const GemmProblem<float>& p, const KernelContext& context) {
  context.workers.For(p.m, [&](std::size_t i, std::size_t) {
    GemmProblem<float> row = p;
    row.m = 1;
    row.a += p.transpose_a ? i : i * p.lda;
    row.c += i * p.ldc;
    GemmRef(row);
  });
}

}  // namespace tilegrad::nn

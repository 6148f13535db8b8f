// SPDX-License-Identifier: Apache-2.0
// One step of Adam over a matrix whose gradient is a product, as that of a linear layer's weight
// is. The gradient is computed block by block and each block is used while in cache. None of it
// goes to memory, which would take as long as the step itself.
#pragma once

#include <cstddef>
#include <span>

#include "nn/kernels/adam.h"
#include "nn/kernels/gemm.h"
#include "nn/kernels/kernel_context.h"

namespace tilegrad::nn {

// The largest k of a product that ProductAdamStep accepts; beyond it multiplication outweighs
// memory traffic.
constexpr std::size_t kMostProductAdamSteps = 256;

// For each the same bits as Gemm(product) into a gradient and AdamStep(adam) over it. `product.c`
// and `adam.gradient` are not used; product.k is in [1, kMostProductAdamSteps], it has no bias and
// does not accumulate, and adam.n = product.m product.n.
struct ProductAdamProblem {
  GemmProblem<float> product;
  AdamProblem<float> adam;
};
// Of several matrices, none of them empty, at most kMostProductAdams: two loops in all.
constexpr std::size_t kMostProductAdams = 16;
void ProductAdamSteps(std::span<const ProductAdamProblem> problems, const KernelContext& context);

}  // namespace tilegrad::nn

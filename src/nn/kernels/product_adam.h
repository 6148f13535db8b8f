// SPDX-License-Identifier: Apache-2.0
// One step of Adam over a matrix whose gradient is a product, such as a linear layer's weight.
// Computes the gradient block by block and uses each block while in cache. None of it goes to
// memory, which would take as long as the step itself.
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

// Gives the same bits as Gemm(product) into a gradient followed by AdamStep(adam). Ignores
// `product.c` and `adam.gradient`; product.k must be in [1, kMostProductAdamSteps], without bias
// and without accumulation, and adam.n = product.m product.n.
struct ProductAdamProblem {
  GemmProblem<float> product;
  AdamProblem<float> adam;
  // A power of two that divides product.k. The gradient is the mean of as many products, each of
  // the next product.k / portions steps, summed in the order of one binary tree: ((p0 + p1) +
  // (p2 + p3)) + .. .
  std::size_t portions = 1;
};
// Several matrices, none of them empty, at most kMostProductAdams: two loops in all.
constexpr std::size_t kMostProductAdams = 16;
void ProductAdamSteps(std::span<const ProductAdamProblem> problems, const KernelContext& context);

}  // namespace tilegrad::nn

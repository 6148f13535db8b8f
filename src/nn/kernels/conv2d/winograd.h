// SPDX-License-Identifier: Apache-2.0
// Convolution with fewer multiplications: Winograd's minimal filtering F(2 x 2, r x r) with r of 2
// or 3, after Lavin and Gray: Fast algorithms for convolutional neural networks, CVPR 2016. A
// stride s first splits image and kernel into s x s phases, each a convolution of stride 1 with
// every s-th tap. For two outputs in a row and r taps, r + 1 products replace 2 r:
//
//   kernel, stride        3x3, 1    4x4, 2    5x5, 2
//   products, direct        36        64       100      per tile of 2 x 2 outputs
//   products, here          16        36        49
//
// With a stride of 1 the input gradient is a convolution of the output's gradient with the kernel
// rotated by 180 degrees; with a stride of 2 it uses the transposed transforms.
//
// The transforms hold 0, 1, -1 and 1/2 only, so that little accuracy is lost: the error is 0.6 to
// 2.4 times that of the direct kernels (tests/nn/kernels/conv2d_test.cc).
#pragma once

#include <cstddef>

#include "nn/kernels/conv2d/conv2d.h"

namespace tilegrad::nn {

// For inputs and for outputs: with fewer the transforms cost more than they save.
inline constexpr std::size_t kLeastWinogradChannels = 16;

// Whether the three functions below accept this shape: square kernels of 2 or 3 taps in each phase,
// and enough channels and pixels that the transforms cost less than they save.
bool WinogradFits(const Conv2dShape& shape);

// Like their namesakes in conv2d.h.
void WinogradForward(const Conv2dShape& shape, const float* x, const float* weight,
                     const float* bias, float* y, const KernelContext& context);
void WinogradInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                       const KernelContext& context);
void WinogradWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                        const KernelContext& context);

}  // namespace tilegrad::nn

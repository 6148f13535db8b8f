// SPDX-License-Identifier: Apache-2.0
// Two-dimensional convolution and its two adjoints, which are each other's derivatives: a
// derivative of any order is again one of these three.
//
//   forward       y[n,o,i,j] = bias[o] + sum_{c,u,v} w[o,c,u,v] x[n,c,i s - p + u,j s - p + v]
//
//   input grad    d_x = the transpose of forward in x, applied to d_y: a transposed convolution
//
//   weight grad   d_w[o,c,u,v] = sum_{n,i,j} d_y[n,o,i,j] x[n,c,i s - p + u,j s - p + v]
//
// with x zero outside the image, s the stride, p the padding. Like the field's "convolution" this
// is a cross-correlation: kernels are not flipped. Tensors are dense: x [N,C,H,W], w [O,C,U,V], y
// [N,O,H',W'].
//
// Each shape takes its fastest algorithm: a matrix product if the kernel is as large as the image,
// Winograd's if it applies (winograd.h), else direct convolution.
//
// The bits of the results depend on shape and SIMD target, never on the number of workers.
#pragma once

#include <cstddef>

#include "nn/kernels/kernel_context.h"
#include "tilegrad/status.h"

namespace tilegrad::nn {

struct Conv2dShape {
  std::size_t batch = 1;          // N
  std::size_t in_channels = 1;    // C
  std::size_t in_height = 1;      // H
  std::size_t in_width = 1;       // W
  std::size_t out_channels = 1;   // O
  std::size_t kernel_height = 1;  // U
  std::size_t kernel_width = 1;   // V
  std::size_t stride = 1;         // both directions, >= 1
  std::size_t padding = 0;        // zeros on all four sides

  std::size_t out_height() const {  // H'
    return (in_height + 2 * padding - kernel_height) / stride + 1;
  }
  std::size_t out_width() const {  // W'
    return (in_width + 2 * padding - kernel_width) / stride + 1;
  }
  std::size_t in_pixels() const { return in_height * in_width; }
  std::size_t out_pixels() const { return out_height() * out_width(); }
  std::size_t kernel_area() const { return kernel_height * kernel_width; }
  // Number of elements in x, in w, in y.
  std::size_t in_size() const { return batch * in_channels * in_pixels(); }
  std::size_t weight_size() const { return out_channels * in_channels * kernel_area(); }
  std::size_t out_size() const { return batch * out_channels * out_pixels(); }

  // OK if every extent but the batch is positive and the kernel fits into the padded image, as the
  // functions below require.
  Status Check() const;
};

// bias [O] or null. Overwrites y.
void Conv2dForward(const Conv2dShape& shape, const float* x, const float* weight, const float* bias,
                   float* y, const KernelContext& context);

// Overwrites d_x.
void Conv2dInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                     const KernelContext& context);

// Overwrites d_weight.
void Conv2dWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                      const KernelContext& context);

}  // namespace tilegrad::nn

// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/conv2d/conv2d.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/conv2d/conv2d.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "nn/kernels/conv2d/conv2d-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "nn/kernels/conv2d/winograd.h"
#include "nn/kernels/gemm.h"

namespace tilegrad::nn {
namespace {

HWY_EXPORT(Conv2dForwardTarget);
HWY_EXPORT(Conv2dInputGradTarget);
HWY_EXPORT(Conv2dWeightGradTarget);

// A kernel that is as large as the image has one place on it: with F = C U V numbers to a filter, x
// is [N, F], w [O, F] and y [N, O], and the three functions are products of these matrices.
bool IsProduct(const Conv2dShape& shape) {
  return shape.padding == 0 && shape.kernel_height == shape.in_height &&
         shape.kernel_width == shape.in_width;
}

std::size_t FilterSize(const Conv2dShape& shape) { return shape.in_channels * shape.kernel_area(); }

// A dense matrix, or its transpose.
struct Factor {
  const float* data;
  std::size_t rows, columns;  // as it lies in memory
  bool transposed = false;
};

void Multiply(const Factor& a, const Factor& b, const float* bias, float* c,
              const KernelContext& context) {
  const std::size_t n = b.transposed ? b.rows : b.columns;
  Gemm({.m = a.transposed ? a.columns : a.rows,
        .n = n,
        .k = a.transposed ? a.rows : a.columns,
        .a = a.data,
        .lda = a.columns,
        .transpose_a = a.transposed,
        .b = b.data,
        .ldb = b.columns,
        .transpose_b = b.transposed,
        .c = c,
        .ldc = n,
        .bias = bias},
       context);
}

// A kernel of one pixel is independent of where pixels lie: those of a small image go into one row,
// which fills vectors better than its own rows. The direct kernels cut images by rows, so a row is
// kept as short as a work item of theirs, kConvPixels.
Conv2dShape Flattened(Conv2dShape shape) {
  constexpr std::size_t kLongestRow = 512;
  if (shape.kernel_area() == 1 && shape.stride == 1 && shape.padding == 0 &&
      shape.in_pixels() <= kLongestRow) {
    shape.in_width = shape.in_pixels();
    shape.in_height = 1;
  }
  return shape;
}

}  // namespace

void Conv2dForward(const Conv2dShape& shape, const float* x, const float* weight, const float* bias,
                   float* y, const KernelContext& context) {
  if (IsProduct(shape)) {
    const std::size_t filter = FilterSize(shape);
    return Multiply({x, shape.batch, filter}, {weight, shape.out_channels, filter, true}, bias, y,
                    context);
  }
  if (context.winograd && WinogradFits(shape)) {
    return WinogradForward(shape, x, weight, bias, y, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dForwardTarget)(Flattened(shape), x, weight, bias, y, context);
}

void Conv2dInputGrad(const Conv2dShape& shape, const float* d_y, const float* weight, float* d_x,
                     const KernelContext& context) {
  if (IsProduct(shape)) {
    const std::size_t filters = shape.out_channels;
    return Multiply({d_y, shape.batch, filters}, {weight, filters, FilterSize(shape)}, nullptr, d_x,
                    context);
  }
  if (context.winograd && WinogradFits(shape)) {
    return WinogradInputGrad(shape, d_y, weight, d_x, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dInputGradTarget)(Flattened(shape), d_y, weight, d_x, context);
}

void Conv2dWeightGrad(const Conv2dShape& shape, const float* x, const float* d_y, float* d_weight,
                      const KernelContext& context) {
  if (shape.batch == 0) {
    std::fill_n(d_weight, shape.weight_size(), 0.0f);
    return;
  }
  if (IsProduct(shape)) {
    return Multiply({d_y, shape.batch, shape.out_channels, true},
                    {x, shape.batch, FilterSize(shape)}, nullptr, d_weight, context);
  }
  if (context.winograd && WinogradFits(shape)) {
    return WinogradWeightGrad(shape, x, d_y, d_weight, context);
  }
  HWY_DYNAMIC_DISPATCH(Conv2dWeightGradTarget)(Flattened(shape), x, d_y, d_weight, context);
}

}  // namespace tilegrad::nn
#endif

// SPDX-License-Identifier: Apache-2.0
// Forward convolution and its input gradient, stated as a ConvProduct each.

#if defined(TILEGRAD_NN_KERNELS_CONV2D_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_CONV2D_INL_H_
#undef TILEGRAD_NN_KERNELS_CONV2D_INL_H_
#else
#define TILEGRAD_NN_KERNELS_CONV2D_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/product-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// The tables of a product in one piece of index memory: phases, then taps, then steps of a block.
inline std::size_t ConvIndexCount(std::size_t phases, std::size_t taps) {
  return phases + 1 + 2 * taps + std::max(kConvDepth * phases + taps, taps);
}

inline ConvTaps LayOutTaps(std::size_t* memory, std::size_t phases, std::size_t taps) {
  return {
      .phase_begin = memory, .plane = memory + phases + 1, .weight = memory + phases + 1 + taps};
}

// Planes of the source of a forward pass or weight gradient: y[i, j] meets x in plane
// (u mod s, v mod s) at (i + u / s, j + v / s).
inline PlaneGrid InputPlanes(const Conv2dShape& s, std::size_t band_rows) {
  return {.height = s.in_height,
          .width = s.in_width,
          .step = s.stride,
          .origin_row = -static_cast<std::ptrdiff_t>(s.padding),
          .origin_column = -static_cast<std::ptrdiff_t>(s.padding),
          .planes_down = std::min(s.stride, s.kernel_height),
          .planes_across = std::min(s.stride, s.kernel_width),
          .rows = band_rows + (s.kernel_height - 1) / s.stride,
          .columns = RoundUp(s.out_width(), kLanes) + (s.kernel_width - 1) / s.stride};
}

inline std::size_t InputPlaneOffset(const PlaneGrid& g, std::size_t u, std::size_t v) {
  const std::size_t plane = (u % g.step) * g.planes_across + v % g.step;
  return plane * g.plane_size() + u / g.step * g.columns + v / g.step;
}

inline ConvTaps ForwardTaps(const Conv2dShape& s, const PlaneGrid& planes, std::size_t* memory) {
  ConvTaps taps = LayOutTaps(memory, 1, s.kernel_area());
  taps.BeginPhases();
  for (std::size_t t = 0; t < s.kernel_area(); ++t) {
    taps.plane[t] = InputPlaneOffset(planes, t / s.kernel_width, t % s.kernel_width);
    taps.weight[t] = t;
  }
  taps.EndPhase(s.kernel_area());
  return taps;
}

// Input pixel h = q s + a (phase a) meets y[q + i] under tap u where u + i s = a + p. Planes are y
// with zeros around it, beginning at the least i.
inline std::ptrdiff_t LeastShift(const Conv2dShape& s, std::size_t kernel) {
  if (s.padding + 1 > kernel) {
    return static_cast<std::ptrdiff_t>(DivideUp(s.padding + 1 - kernel, s.stride));
  }
  return -static_cast<std::ptrdiff_t>((kernel - 1 - s.padding) / s.stride);
}

// How many i there are.
inline std::size_t ShiftCount(const Conv2dShape& s, std::size_t kernel) {
  const auto last = static_cast<std::ptrdiff_t>((s.padding + s.stride - 1) / s.stride);
  return static_cast<std::size_t>(last - LeastShift(s, kernel)) + 1;
}

inline PlaneGrid OutputPlanes(const Conv2dShape& s, std::size_t band_rows,
                              std::size_t grid_columns) {
  return {.height = s.out_height(),
          .width = s.out_width(),
          .step = 1,
          .origin_row = LeastShift(s, s.kernel_height),
          .origin_column = LeastShift(s, s.kernel_width),
          .planes_down = 1,
          .planes_across = 1,
          .rows = band_rows + ShiftCount(s, s.kernel_height) - 1,
          .columns = RoundUp(grid_columns, kLanes) + ShiftCount(s, s.kernel_width) - 1};
}

inline ConvTaps InputGradTaps(const Conv2dShape& s, const PlaneGrid& planes, std::size_t* memory) {
  const auto shift = [&s](std::size_t phase, std::size_t tap, std::ptrdiff_t least) {
    const auto ahead = static_cast<std::ptrdiff_t>(phase + s.padding);
    const auto multiple = ahead - static_cast<std::ptrdiff_t>(tap);
    return static_cast<std::size_t>(multiple / static_cast<std::ptrdiff_t>(s.stride) - least);
  };
  ConvTaps taps = LayOutTaps(memory, s.stride * s.stride, s.kernel_area());
  taps.BeginPhases();
  std::size_t t = 0;
  for (std::size_t phase = 0; phase < s.stride * s.stride; ++phase) {
    const std::size_t a = phase / s.stride, b = phase % s.stride;
    for (std::size_t u = (a + s.padding) % s.stride; u < s.kernel_height; u += s.stride) {
      for (std::size_t v = (b + s.padding) % s.stride; v < s.kernel_width; v += s.stride, ++t) {
        taps.plane[t] =
            shift(a, u, planes.origin_row) * planes.columns + shift(b, v, planes.origin_column);
        taps.weight[t] = u * s.kernel_width + v;
      }
    }
    taps.EndPhase(t);
  }
  return taps;
}

inline void RunConvProduct(const ConvProduct& p, const KernelContext& context,
                           std::size_t* offsets) {
  ConvWork work(p);
  const std::size_t weight_size = RoundUp(p.rows * p.channels * p.tap_count(), kAlignment);
  work.packed_weight = context.scratch.Floats(
      weight_size + work.worker_size() * static_cast<std::size_t>(context.workers.count()));
  work.offsets = offsets;
  FillConvOffsets(p, work);
  context.workers.For(work.panels.count(), [&](std::size_t panel, std::size_t) {
    for (std::size_t block = 0; block < work.blocks.count(); ++block) {
      for (std::size_t phase = 0; phase < p.taps.phases; ++phase) {
        PackConvWeights(p, work, panel, block, phase,
                        PackedConvWeights(p, work, panel, block, phase));
      }
    }
  });
  context.workers.For(p.cut.pieces(), [&](std::size_t piece, std::size_t worker) {
    RunConvPiece(p, work, BatchPiece(p.cut, piece),
                 work.packed_weight + weight_size + worker * work.worker_size());
  });
}

// Pixels of a work item out of `pixels`: `most`, the best size for one worker's caches. With
// several workers about four items each, for load balance, unless those would be so small that
// overhead dominates.
inline std::size_t PiecePixels(std::size_t pixels, std::size_t most, const KernelContext& context) {
  const auto workers = static_cast<std::size_t>(context.workers.count());
  if (workers == 1) return most;
  return std::clamp(pixels / (4 * workers), kConvPixels / 4, most);
}

void Conv2dForwardTarget(const Conv2dShape& s, const float* x, const float* weight,
                         const float* bias, float* y, const KernelContext& context) {
  const BatchCut cut(s.batch, s.out_height(), s.out_width(),
                     PiecePixels(s.batch * s.out_pixels(), kConvPixels, context));
  const PlaneGrid planes = InputPlanes(s, cut.bands.largest());
  std::size_t* indices = context.scratch.Indices(ConvIndexCount(1, s.kernel_area()));
  const ConvProduct product{.source = x,
                            .batch = s.batch,
                            .channels = s.in_channels,
                            .planes = planes,
                            .weight = weight,
                            .weight_row_stride = s.in_channels * s.kernel_area(),
                            .weight_channel_stride = s.kernel_area(),
                            .taps = ForwardTaps(s, planes, indices),
                            .rows = s.out_channels,
                            .grid_rows = s.out_height(),
                            .grid_columns = s.out_width(),
                            .bias = bias,
                            .target = y,
                            .target_height = s.out_height(),
                            .target_width = s.out_width(),
                            .stride = 1,
                            .cut = cut};
  RunConvProduct(product, context, product.taps.weight + s.kernel_area());
}

void Conv2dInputGradTarget(const Conv2dShape& s, const float* d_y, const float* weight, float* d_x,
                           const KernelContext& context) {
  const std::size_t phases = s.stride * s.stride;
  const std::size_t rows = DivideUp(s.in_height, s.stride);
  const std::size_t columns = DivideUp(s.in_width, s.stride);
  const std::size_t most = phases == 1 ? kConvPixels : kPhasePixels;
  const BatchCut cut(s.batch, rows, columns, PiecePixels(s.batch * rows * columns, most, context));
  const PlaneGrid planes = OutputPlanes(s, cut.bands.largest(), columns);
  std::size_t* indices = context.scratch.Indices(ConvIndexCount(phases, s.kernel_area()));
  const ConvProduct product{.source = d_y,
                            .batch = s.batch,
                            .channels = s.out_channels,
                            .planes = planes,
                            .weight = weight,
                            .weight_row_stride = s.kernel_area(),
                            .weight_channel_stride = s.in_channels * s.kernel_area(),
                            .taps = InputGradTaps(s, planes, indices),
                            .rows = s.in_channels,
                            .grid_rows = rows,
                            .grid_columns = columns,
                            .bias = nullptr,
                            .target = d_x,
                            .target_height = s.in_height,
                            .target_width = s.in_width,
                            .stride = s.stride,
                            .cut = cut};
  RunConvProduct(product, context, product.taps.weight + s.kernel_area());
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

// SPDX-License-Identifier: Apache-2.0
// Forward convolution and its input gradient, each expressed as a ConvProduct.

#include <hwy/highway.h>

#include <algorithm>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/product-inl.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// The tables of a product in one block of index memory: phases, then taps, then steps of a block.
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

// Input pixel h = q s + a (phase a) pairs with y[q + i] under tap u, where u + i s = a + p. Planes
// are y padded with zeros, starting at the least i.
inline std::ptrdiff_t LeastShift(const Conv2dShape& s, std::size_t kernel) {
  if (s.padding + 1 > kernel) {
    return static_cast<std::ptrdiff_t>(DivideUp(s.padding + 1 - kernel, s.stride));
  }
  return -static_cast<std::ptrdiff_t>((kernel - 1 - s.padding) / s.stride);
}

// The number of such i.
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
  work.packed_weight =
      context.scratch.Floats(weight_size + work.worker_size() * context.workers.size());
  work.offsets = offsets;
  FillConvOffsets(p, work);
  context.workers.For(work.panels.count(), [&](std::size_t panel) {
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

// The pixels per work item out of `pixels`: `most`, the best size for one worker's caches. With
// several workers about four items each, for load balance, unless those would be so small that
// overhead dominates.
inline std::size_t PiecePixels(std::size_t pixels, std::size_t most, const KernelContext& context) {
  const auto workers = context.workers.size();
  if (workers == 1) return most;
  const std::size_t least = kConvPixels / (workers > kFewWorkers ? 16 : 4);
  return std::clamp(pixels / (4 * workers), least, most);
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

// Weight gradient of a convolution as an implicit matrix product: rows are (input channel, tap),
// columns the output channels, k runs over pixels and images. The rows' factor is read in place
// from the padded planes of x; d_y is packed transposed. Work items own a block of the weights for
// a fixed share of the batch; shares are added in order.

constexpr std::size_t kWeightTaps = 400;     // rows of one work item, about
constexpr std::size_t kWeightColumns = 128;  // output channels of one work item
constexpr std::size_t kWeightPixels = 256;   // steps of k in one pass, about
constexpr std::size_t kWeightItems = 16;     // target number of work items, if the batch allows

struct WeightGradPlan {
  WeightGradPlan(const Conv2dShape& shape, const float* x_data, const float* d_y_data)
      : s(shape),
        x(x_data),
        d_y(d_y_data),
        blocks(s.in_channels, std::max<std::size_t>(1, kWeightTaps / s.kernel_area())),
        column_blocks(DivideUp(s.out_channels, kTileColumns), kWeightColumns / kTileColumns),
        cut(s.batch, s.out_height(), s.out_width(), kWeightPixels),
        shares(cut.pieces(), DivideUp(cut.pieces(), DivideUp(kWeightItems, blocks_count()))),
        planes(InputPlanes(s, cut.bands.largest())) {}

  std::size_t blocks_count() const { return blocks.count() * column_blocks.count(); }
  std::size_t item_count() const { return blocks_count() * shares.count(); }
  std::size_t columns() const { return column_blocks.largest() * kTileColumns; }
  // Floats in one item's sums [taps of the block][columns()], packed d_y and planes, and per
  // worker.
  std::size_t sums_size() const { return blocks.largest() * s.kernel_area() * columns(); }
  std::size_t piece_pixels() const { return cut.images * cut.bands.largest() * s.out_width(); }
  std::size_t packed_size() const { return piece_pixels() * columns(); }
  std::size_t image_size() const { return blocks.largest() * planes.channel_size(); }
  std::size_t planes_size() const { return cut.images * image_size() + kTileColumns; }
  std::size_t worker_size() const { return RoundUp(packed_size() + planes_size(), kAlignment); }

  Conv2dShape s;
  const float *x, *d_y;
  Panels blocks;         // of input channels
  Panels column_blocks;  // of panels of output channels
  BatchCut cut;
  Panels shares;  // of the pieces of the batch
  PlaneGrid planes;
  const std::size_t* offsets = nullptr;  // of each (channel of a block, tap) in the planes
};

struct WeightGradItem {
  WeightGradItem(const WeightGradPlan& plan, std::size_t index)
      : share(index / plan.blocks_count()),
        block(index % plan.blocks.count()),
        column(plan.column_blocks.begin(index / plan.blocks.count() % plan.column_blocks.count()) *
               kTileColumns),
        columns(std::min(
            plan.s.out_channels - column,
            plan.column_blocks.size(index / plan.blocks.count() % plan.column_blocks.count()) *
                kTileColumns)) {}
  std::size_t share, block;
  std::size_t column, columns;  // output channels
};

// d_y of the piece, transposed: panels of [pixel][kTileColumns], zeros behind the last channel.
inline void PackOutputGrad(const WeightGradPlan& plan, const WeightGradItem& item,
                           const BatchPiece& piece, float* packed) {
  const std::size_t pixels = piece.rows * plan.s.out_width();
  for (std::size_t j = 0; j < item.columns; j += kTileColumns) {
    const std::size_t columns = std::min(kTileColumns, item.columns - j);
    for (std::size_t n = piece.image; n < piece.image_end; ++n, packed += pixels * kTileColumns) {
      const float* d_y = plan.d_y +
                         (n * plan.s.out_channels + item.column + j) * plan.s.out_pixels() +
                         piece.row * plan.s.out_width();
      if (columns < kTileColumns) std::fill_n(packed, pixels * kTileColumns, 0.0f);
      TransposeStrip(d_y, plan.s.out_pixels(), columns, pixels, packed, kTileColumns);
    }
  }
}

// One pass over a piece of the batch, for one item.
struct WeightGradPass {
  const WeightGradPlan& plan;
  const BatchPiece& piece;
  const float* planes;
  bool accumulate;
};

template <std::size_t R>
HWY_INLINE void WeightGradTile(const WeightGradPass& pass, std::size_t row, PackedColumns columns,
                               float* c) {
  const WeightGradPlan& plan = pass.plan;
  PlainRows<R> rows;
  for (std::size_t r = 0; r < R; ++r) rows.data[r] = pass.planes + plan.offsets[row + r];
  Tile<R> tile;
  tile.Clear();
  for (std::size_t n = 0; n < pass.piece.image_end - pass.piece.image; ++n) {
    for (std::size_t y = 0; y < pass.piece.rows; ++y) {
      rows.k = n * plan.image_size() + y * plan.planes.columns;
      tile.Multiply(rows, columns, plan.s.out_width());
    }
  }
  tile.Store({.c = c,
              .ldc = plan.columns(),
              .offset = {0, kLanes},
              .count = {kLanes, kLanes},
              .accumulate = pass.accumulate});
}

template <std::size_t R = kTileRows>
HWY_INLINE void WeightGradTileOf(std::size_t rows, const WeightGradPass& pass, std::size_t row,
                                 PackedColumns columns, float* c) {
  if (rows == R) {
    WeightGradTile<R>(pass, row, columns, c);
  } else if constexpr (R > 1) {
    WeightGradTileOf<R - 1>(rows, pass, row, columns, c);
  }
}

inline void RunWeightGradPass(const WeightGradPass& pass, const WeightGradItem& item,
                              const float* packed, float* sums) {
  const WeightGradPlan& plan = pass.plan;
  const Panels panels(plan.blocks.size(item.block) * plan.s.kernel_area(), kTileRows);
  const std::size_t steps =
      (pass.piece.image_end - pass.piece.image) * pass.piece.rows * plan.s.out_width();
  for (std::size_t j = 0; j < item.columns; j += kTileColumns) {
    for (std::size_t panel = 0; panel < panels.count(); ++panel) {
      const std::size_t row = panels.begin(panel);
      WeightGradTileOf(panels.size(panel), pass, row, PackedColumns{packed + j * steps},
                       sums + row * plan.columns() + j);
    }
  }
}

inline void RunWeightGradItem(const WeightGradPlan& plan, std::size_t index, float* sums,
                              float* memory) {
  const WeightGradItem item(plan, index);
  float* packed = memory;
  float* planes = memory + plan.packed_size();
  const std::size_t channel = plan.blocks.begin(item.block);
  const std::size_t first = plan.shares.begin(item.share);
  for (std::size_t i = first; i < first + plan.shares.size(item.share); ++i) {
    const BatchPiece piece(plan.cut, i);
    for (std::size_t n = piece.image; n < piece.image_end; ++n) {
      CopyPlanes(plan.planes, plan.x + (n * plan.s.in_channels + channel) * plan.s.in_pixels(),
                 plan.blocks.size(item.block), piece.row,
                 planes + (n - piece.image) * plan.image_size());
    }
    PackOutputGrad(plan, item, piece, packed);
    RunWeightGradPass({plan, piece, planes, i > first}, item, packed, sums);
  }
}

// Adds the shares of one block in order and rearranges the sums to d_weight's layout.
inline void FinishWeightGrad(const WeightGradPlan& plan, std::size_t index, float* sums,
                             float* d_weight) {
  const WeightGradItem item(plan, index);
  float* total = sums + index * plan.sums_size();
  for (std::size_t share = 1; share < plan.shares.count(); ++share) {
    const float* part = total + share * plan.blocks_count() * plan.sums_size();
    for (std::size_t i = 0; i < plan.sums_size(); ++i) total[i] += part[i];
  }
  const std::size_t area = plan.s.kernel_area(), row_size = plan.s.in_channels * area;
  TransposeStrip(total, plan.columns(), plan.blocks.size(item.block) * area, item.columns,
                 d_weight + item.column * row_size + plan.blocks.begin(item.block) * area,
                 row_size);
}

inline void FillWeightGradOffsets(const WeightGradPlan& plan, std::size_t* offsets) {
  for (std::size_t c = 0; c < plan.blocks.largest(); ++c) {
    for (std::size_t tap = 0; tap < plan.s.kernel_area(); ++tap) {
      *offsets++ =
          c * plan.planes.channel_size() +
          InputPlaneOffset(plan.planes, tap / plan.s.kernel_width, tap % plan.s.kernel_width);
    }
  }
}

void Conv2dWeightGradTarget(const Conv2dShape& s, const float* x, const float* d_y, float* d_weight,
                            const KernelContext& context) {
  WeightGradPlan plan(s, x, d_y);
  std::size_t* offsets = context.scratch.Indices(plan.blocks.largest() * s.kernel_area());
  FillWeightGradOffsets(plan, offsets);
  plan.offsets = offsets;
  const std::size_t sums_size = RoundUp(plan.item_count() * plan.sums_size(), kAlignment);
  float* sums = context.scratch.Floats(sums_size + plan.worker_size() * context.workers.size());
  context.workers.For(plan.item_count(), [&](std::size_t item, std::size_t worker) {
    RunWeightGradItem(plan, item, sums + item * plan.sums_size(),
                      sums + sums_size + worker * plan.worker_size());
  });
  context.workers.For(plan.blocks_count(),
                      [&](std::size_t index) { FinishWeightGrad(plan, index, sums, d_weight); });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

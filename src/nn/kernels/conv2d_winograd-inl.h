// SPDX-License-Identifier: Apache-2.0
// The three passes of conv2d_winograd.h. Each takes some rows of tiles at a time, so that memory
// stays small: transform, one product for each slot, transform back.

#if defined(TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#undef TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#else
#define TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/conv2d_winograd_product-inl.h"
#include "nn/kernels/conv2d_winograd_tiles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kValuesAtATime = std::size_t{1} << 21;  // transformed, of both sides, about

// Rows of tiles in portions that hold about kValuesAtATime.
struct Portions {
  explicit Portions(const WinogradPlan& plan)
      : input{plan, true},
        output{plan, false},
        cut(plan.tile_rows(),
            std::max<std::size_t>(
                1, kValuesAtATime / ((input.total() + output.total()) * plan.tiles_across))),
        largest(plan, 0, cut.largest(), kTileColumns) {}
  TileRows rows(std::size_t portion) const {
    return {input.plan, cut.begin(portion), cut.size(portion), kTileColumns};
  }
  std::size_t worker_size() const {
    const std::size_t places = PlacesSize(input.plan, largest) + PaddedRowSize(input.plan);
    return RoundUp(std::max(places, TileRowQuadsSize(input.plan)), kAlignment);
  }

  WinogradSide input, output;
  Panels cut;
  TileRows largest;
};

// The scratch memory of a pass: packed weights (or sums), values of both sides, workers' own.
struct WinogradMemory {
  WinogradMemory(const Portions& portions, std::size_t weights_size, const KernelContext& context)
      : worker_size(portions.worker_size()) {
    const std::size_t first = RoundUp(weights_size, kAlignment);
    const std::size_t in = RoundUp(SlotLayoutSize(portions.input, portions.largest), kAlignment);
    // In whole panels of channels, for the weight gradient.
    const std::size_t out =
        RoundUp(SlotLayoutSize(portions.output, portions.largest) +
                    portions.input.plan.slots() * kTileColumns * portions.largest.pitch,
                kAlignment);
    weights = context.scratch.Floats(
        first + in + out + worker_size * static_cast<std::size_t>(context.workers.count()));
    inputs = weights + first;
    outputs = inputs + in;
    workers = outputs + out;
  }
  float* worker(std::size_t index) const { return workers + index * worker_size; }

  float *weights, *inputs, *outputs, *workers;
  std::size_t worker_size;
};

inline void TransformInput(const WinogradPlan& plan, const TileRows& rows, const SlotLayout& layout,
                           const float* x, std::size_t c, float* memory, float* values) {
  GatherInput(plan, rows, x, c, memory, memory + PlacesSize(plan, rows));
  ForPhases<TransformPhase>({plan, rows, layout, c}, memory, values);
}

void WinogradForwardTarget(const Conv2dShape& s, const float* x, const float* weight,
                           const float* bias, float* y, const KernelContext& context) {
  const WinogradPlan plan(s);
  const Portions portions(plan);
  const PackedWinogradWeights packed(portions.output, portions.input);
  const WinogradMemory memory(portions, packed.size(), context);
  packed.Fill(weight, memory.weights, context.workers);
  for (std::size_t portion = 0; portion < portions.cut.count(); ++portion) {
    const TileRows rows = portions.rows(portion);
    const SlotLayout in = PanelLayout(portions.input, rows);
    const SlotLayout out = RowLayout(portions.output, rows);
    context.workers.For(s.in_channels, [&](std::size_t c, std::size_t worker) {
      TransformInput(plan, rows, in, x, c, memory.worker(worker), memory.inputs);
    });
    MultiplySlots({packed, memory.weights, in, memory.inputs, out, memory.outputs, rows},
                  context.workers);
    context.workers.For(s.out_channels, [&](std::size_t o, std::size_t worker) {
      float* quads = memory.worker(worker);
      const float offset = bias == nullptr ? 0.0f : bias[o];
      if (plan.axis_slots == 4) {
        TransformOutput<4>(rows, out, o, offset, memory.outputs, quads);
      } else {
        TransformOutput<3>(rows, out, o, offset, memory.outputs, quads);
      }
      ScatterOutput(plan, rows, quads, o, y);
    });
  }
}

void WinogradInputGradTarget(const Conv2dShape& s, const float* d_y, const float* weight,
                             float* d_x, const KernelContext& context) {
  const WinogradPlan plan(s);
  const Portions portions(plan);
  const PackedWinogradWeights packed(portions.input, portions.output);
  const WinogradMemory memory(portions, packed.size(), context);
  packed.Fill(weight, memory.weights, context.workers);
  for (std::size_t portion = 0; portion < portions.cut.count(); ++portion) {
    const TileRows rows = portions.rows(portion);
    const SlotLayout in = RowLayout(portions.input, rows);
    const SlotLayout out = PanelLayout(portions.output, rows);
    context.workers.For(s.out_channels, [&](std::size_t o, std::size_t worker) {
      float* quads = memory.worker(worker);
      GatherOutputGrad(plan, rows, d_y, o, quads);
      if (plan.axis_slots == 4) {
        TransformOutputGrad<4>(rows, out, o, quads, memory.outputs);
      } else {
        TransformOutputGrad<3>(rows, out, o, quads, memory.outputs);
      }
    });
    MultiplySlots({packed, memory.weights, out, memory.outputs, in, memory.inputs, rows},
                  context.workers);
    context.workers.For(s.in_channels, [&](std::size_t c, std::size_t worker) {
      float* places = memory.worker(worker);
      ForPhases<TransformPhaseBack>({plan, rows, in, c}, memory.inputs, places);
      ScatterInputGrad(plan, rows, places, c, d_x, places + PlacesSize(plan, rows));
    });
  }
}

void WinogradWeightGradTarget(const Conv2dShape& s, const float* x, const float* d_y,
                              float* d_weight, const KernelContext& context) {
  const WinogradPlan plan(s);
  const Portions portions(plan);
  const std::size_t panels = DivideUp(s.out_channels, kTileColumns);
  const WinogradMemory memory(portions, portions.input.total() * panels * kTileColumns, context);
  for (std::size_t portion = 0; portion < portions.cut.count(); ++portion) {
    const TileRows rows = portions.rows(portion);
    const SlotLayout in = RowLayout(portions.input, rows);
    const bool last = portion + 1 == portions.cut.count();
    const WinogradCorrelation product{portions.input, in,   memory.inputs, memory.outputs,
                                      memory.weights, rows, panels,        portion > 0};
    context.workers.For(s.in_channels, [&](std::size_t c, std::size_t worker) {
      TransformInput(plan, rows, in, x, c, memory.worker(worker), memory.inputs);
    });
    context.workers.For(panels, [&](std::size_t panel, std::size_t worker) {
      TransformOutputPanel(product, d_y, panel, memory.worker(worker));
    });
    product.Multiply(context.workers);
    if (!last) continue;
    context.workers.For(panels, [&](std::size_t panel, std::size_t) {
      FinishWeightGrad(product, panel, d_weight);
    });
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

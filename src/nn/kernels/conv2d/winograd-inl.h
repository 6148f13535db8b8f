// SPDX-License-Identifier: Apache-2.0
// The three passes of winograd.h. Each takes some rows of tiles at a time: transform, one
// product for each slot, transform back.

#if defined(TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#undef TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#else
#define TILEGRAD_NN_CONV2D_WINOGRAD_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "nn/kernels/conv2d/winograd_portions-inl.h"
#include "nn/kernels/conv2d/winograd_product-inl.h"
#include "nn/kernels/conv2d/winograd_tiles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

inline void TransformInput(const WinogradPlan& plan, const TileRows& rows, const SlotLayout& layout,
                           const float* x, std::size_t c, float* memory, float* values) {
  GatherInput(plan, rows, x, c, memory, memory + PlacesSize(plan, rows));
  ForPhases<TransformPhase>({plan, rows, layout, c}, memory, values);
}

struct WinogradOperands {
  const float *x, *weight, *bias;
  WeightsOf weights_of;
  float* y;
};

inline void Convolve(const WinogradPlan& plan, const WinogradOperands& operands,
                     const KernelContext& context) {
  const Portions portions(plan, OwnPortions(plan, 1, context.workers));
  const PackedWinogradWeights packed(portions.output, portions.input, operands.weights_of);
  const WinogradMemory memory(portions, packed.size(), context);
  packed.Fill(operands.weight, memory.weights, context.workers);
  ForPortions(portions, context.workers, [&](const TileRows& rows, const auto& loops) {
    const SlotLayout in = PanelLayout(portions.input, rows);
    const SlotLayout out = RowLayout(portions.output, rows);
    float *const inputs = memory.inputs(loops.owner), *const outputs = memory.outputs(loops.owner);
    loops.For(plan.s.in_channels, [&](std::size_t c, std::size_t worker) {
      TransformInput(plan, rows, in, operands.x, c, memory.places(worker), inputs);
    });
    MultiplySlots({packed, memory.weights, in, inputs, out, outputs, rows}, loops);
    loops.For(plan.s.out_channels, [&](std::size_t o, std::size_t worker) {
      float* quads = memory.places(worker);
      const float offset = operands.bias == nullptr ? 0.0f : operands.bias[o];
      if (plan.axis_slots == 4) {
        TransformOutput<4>(rows, out, o, offset, outputs, quads);
      } else {
        TransformOutput<3>(rows, out, o, offset, outputs, quads);
      }
      ScatterOutput(plan, rows, quads, o, operands.y);
    });
  });
}

void WinogradForwardTarget(const Conv2dShape& s, const float* x, const float* weight,
                           const float* bias, float* y, const KernelContext& context) {
  Convolve(WinogradPlan(s), {x, weight, bias, WeightsOf::kItself, y}, context);
}

// The convolution that leads from d_y to d_x, for a stride of 1: its tiles do not overlap, and
// need not be whole images.
inline Conv2dShape TransposeOf(const Conv2dShape& s) {
  Conv2dShape t = s;
  t.in_channels = s.out_channels;
  t.out_channels = s.in_channels;
  t.in_height = s.out_height();
  t.in_width = s.out_width();
  t.padding = s.kernel_height - 1 - s.padding;
  return t;
}

void WinogradInputGradTarget(const Conv2dShape& s, const float* d_y, const float* weight,
                             float* d_x, const KernelContext& context) {
  if (s.stride == 1) {
    Convolve(WinogradPlan(TransposeOf(s)), {d_y, weight, nullptr, WeightsOf::kTranspose, d_x},
             context);
    return;
  }
  const WinogradPlan plan(s);
  // Rows of tiles of one image add to the same pixels.
  const Portions portions(plan, OwnPortions(plan, plan.tiles_down, context.workers));
  const PackedWinogradWeights packed(portions.input, portions.output);
  const WinogradMemory memory(portions, packed.size(), context);
  packed.Fill(weight, memory.weights, context.workers);
  ForPortions(portions, context.workers, [&](const TileRows& rows, const auto& loops) {
    const SlotLayout in = RowLayout(portions.input, rows);
    const SlotLayout out = PanelLayout(portions.output, rows);
    float *const inputs = memory.inputs(loops.owner), *const outputs = memory.outputs(loops.owner);
    loops.For(s.out_channels, [&](std::size_t o, std::size_t worker) {
      float* quads = memory.places(worker);
      GatherOutputGrad(plan, rows, d_y, o, quads);
      if (plan.axis_slots == 4) {
        TransformOutputGrad<4>(rows, out, o, quads, outputs);
      } else {
        TransformOutputGrad<3>(rows, out, o, quads, outputs);
      }
    });
    MultiplySlots({packed, memory.weights, out, outputs, in, inputs, rows}, loops);
    loops.For(s.in_channels, [&](std::size_t c, std::size_t worker) {
      float* places = memory.places(worker);
      ForPhases<TransformPhaseBack>({plan, rows, in, c}, inputs, places);
      ScatterInputGrad(plan, rows, places, c, d_x, places + PlacesSize(plan, rows));
    });
  });
}

void WinogradWeightGradTarget(const Conv2dShape& s, const float* x, const float* d_y,
                              float* d_weight, const KernelContext& context) {
  const WinogradPlan plan(s);
  const Portions portions(plan, SharedPortions(plan));  // which is the order of the sums
  const std::size_t count = portions.cut.units.count();
  const std::size_t panels = DivideUp(s.out_channels, kTileColumns);
  const WinogradMemory memory(portions, portions.input.total() * panels * kTileColumns, context);
  float *const inputs = memory.inputs(0), *const outputs = memory.outputs(0);
  for (std::size_t portion = 0; portion < count; ++portion) {
    const TileRows rows = portions.rows(portion);
    const SlotLayout in = RowLayout(portions.input, rows);
    const WinogradCorrelation product{portions.input, in,   inputs, outputs,
                                      memory.weights, rows, panels, portion > 0};
    const std::size_t items = OutputItems(product);
    context.workers.For(items + s.in_channels, [&](std::size_t index, std::size_t worker) {
      if (index < items) {
        TransformOutputRows(product, d_y, index, memory.places(worker));
      } else {
        TransformInput(plan, rows, in, x, index - items, memory.places(worker), inputs);
      }
    });
    product.Multiply(context.workers);
    if (portion + 1 < count) continue;
    context.workers.For(panels, [&](std::size_t panel, std::size_t) {
      FinishWeightGrad(product, panel, d_weight);
    });
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

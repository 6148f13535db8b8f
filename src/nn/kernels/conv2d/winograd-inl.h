// SPDX-License-Identifier: Apache-2.0
// The three passes of winograd.h. Each processes some rows of tiles at a time: transform, one
// product per slot, inverse transform.

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "base/parallel.h"
#include "nn/kernels/conv2d/winograd_product-inl.h"
#include "nn/kernels/conv2d/winograd_tiles-inl.h"
#include "nn/kernels/kernel_context.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// A pass of winograd.h processes the tiles in portions, so that memory stays small.
// If there are enough portions, each worker takes its own, which stay in its caches and need no
// synchronisation. Else all workers share each portion, in three loops.

// Transformed values of both sides in a portion shared by all workers, about: 8 MB.
constexpr std::size_t kSharedValues = std::size_t{1} << 21;
// In a worker's own portion, about: 2 MB, the best of 1 to 8.
constexpr std::size_t kOwnValues = std::size_t{1} << 19;
// But at least this many tiles, since every portion reads all weights again: with 38 and 19 tiles
// 256 to 512 channels took 1.14 and 1.5 times as long.
constexpr std::size_t kOwnTiles = 64;

// The rows of tiles, in groups of `unit`, divided into portions.
struct PortionCut {
  bool own;  // each worker has its own portions; else all share each
  std::size_t unit;
  Panels units;
};

inline std::size_t ValuesOfRow(const WinogradPlan& plan) {
  return (WinogradSide{plan, true}.total() + WinogradSide{plan, false}.total()) * plan.tiles_across;
}

inline PortionCut SharedPortions(const WinogradPlan& plan, std::size_t values = kSharedValues) {
  const std::size_t rows = std::max<std::size_t>(1, values / ValuesOfRow(plan));
  return {false, 1, Panels(plan.tile_rows(), rows)};
}

// How many portions of a worker's own there may be, `unit` rows of tiles staying together; 0 if
// those would be too large.
inline std::size_t MostOwnPortions(const WinogradPlan& plan, std::size_t unit) {
  if (unit * ValuesOfRow(plan) > kSharedValues) return 0;
  const std::size_t rows =
      std::max(DivideUp(kOwnTiles, plan.tiles_across), kOwnValues / ValuesOfRow(plan));
  return std::max<std::size_t>(1, plan.tile_rows() / unit / DivideUp(rows, unit));
}

inline PortionCut OwnPortions(const WinogradPlan& plan, std::size_t unit, std::size_t count) {
  const std::size_t units = plan.tile_rows() / unit;
  return {true, unit, Panels::Parts(units, std::min(units, count))};
}

// Each worker gets its own portions if there are at least two per worker, or one with many workers,
// since starting loops together then costs more than waiting for the last. Shared portions grow
// with the number of workers, as do their caches.
inline PortionCut PortionsFor(const WinogradPlan& plan, std::size_t unit, const Workers& workers) {
  const auto count = workers.size();
  const std::size_t most = MostOwnPortions(plan, unit);
  const std::size_t least = count > 1 && count <= kFewWorkers ? 2 * count : count;
  if (most >= least) return OwnPortions(plan, unit, RoundUp(most, count));
  return SharedPortions(plan, kSharedValues * std::max<std::size_t>(1, count / kFewWorkers));
}

// Weight gradients are summed in groups of portions, a worker's own: where two cores share no
// cache, writing what the other has read takes 4 times as long. Each group costs memory for its
// sums; more workers than groups help each other.
constexpr std::size_t kSumGroups = 16;
// The values of a group per value of its sums, at least, so that merging costs little.
constexpr std::size_t kValuesPerSum = 4;

inline std::size_t WeightSumsSize(const WinogradPlan& plan) {
  return WinogradSide{plan, true}.total() * RoundUp(plan.s.out_channels, kTileColumns);
}

// The bits of weight gradients depend on this, and so it depends on the shape alone.
inline PortionCut WeightGradPortions(const WinogradPlan& plan) {
  const std::size_t most = MostOwnPortions(plan, 1);
  const std::size_t values = plan.tile_rows() * ValuesOfRow(plan);
  if (most < kSumGroups || values < kValuesPerSum * kSumGroups * WeightSumsSize(plan)) {
    return SharedPortions(plan);
  }
  return OwnPortions(plan, 1, RoundUp(most, kSumGroups));
}

struct Portions {
  Portions(const WinogradPlan& plan, const PortionCut& portions)
      : input{plan, true},
        output{plan, false},
        cut(portions),
        largest(plan, 0, cut.unit * cut.units.largest(), kTileColumns) {}
  TileRows rows(std::size_t portion) const {
    return {input.plan, cut.unit * cut.units.begin(portion), cut.unit * cut.units.size(portion),
            kTileColumns};
  }

  WinogradSide input, output;
  PortionCut cut;
  TileRows largest;
};

// The scratch memory of a pass: packed weights (or sums), then per worker (or once for all) the
// values of both sides, then each worker's other scratch.
struct WinogradMemory {
  WinogradMemory(const Portions& portions, std::size_t weights_size, const KernelContext& context)
      : inputs_size(RoundUp(SlotLayoutSize(portions.input, portions.largest), kAlignment)),
        // In whole panels of channels, for the weight gradient.
        values_size(inputs_size +
                    RoundUp(SlotLayoutSize(portions.output, portions.largest) +
                                portions.input.plan.slots() * kTileColumns * portions.largest.pitch,
                            kAlignment)),
        places_size(PlacesOfWorker(portions)) {
    const auto count = context.workers.size();
    const std::size_t first = RoundUp(weights_size, kAlignment);
    const std::size_t all_values = (portions.cut.own ? count : 1) * values_size;
    weights = context.scratch.Floats(first + all_values + count * places_size);
    values = weights + first;
    all_places = values + all_values;
  }
  static std::size_t PlacesOfWorker(const Portions& portions) {
    const WinogradPlan& plan = portions.input.plan;
    const std::size_t places = PlacesSize(plan, portions.largest) + PaddedRowsSize(plan);
    return RoundUp(std::max(places, TileRowQuadsSize(plan)), kAlignment);
  }
  // `owner`: the worker that owns the portion, 0 if all share it.
  float* inputs(std::size_t owner) const { return values + owner * values_size; }
  float* outputs(std::size_t owner) const { return inputs(owner) + inputs_size; }
  float* places(std::size_t worker) const { return all_places + worker * places_size; }

  std::size_t inputs_size, values_size, places_size;
  float *weights, *values, *all_places;
};

// The loops of a portion: shared by all workers, or run by its owner, helped by workers without
// portions left.
struct SharedLoops {
  const Workers& workers;
  static constexpr std::size_t owner = 0;
  std::size_t workers_sharing() const { return workers.size(); }
  template <class Task>
  void For(std::size_t n, const Task& task, LoopSite site = LoopSite::Here()) const {
    workers.For(n, task, site);
  }
};

struct OwnLoops {
  const Workers::Part& part;
  std::size_t owner;
  static std::size_t workers_sharing() { return 1; }
  template <class Task>
  void For(std::size_t n, const Task& task, LoopSite site = LoopSite::Here()) const {
    part.For(n, task, site);
  }
};

// Calls run(index, loops) for `count` parts, each of one worker or all of them shared.
template <class Run>
void ForOwnOrShared(bool own, std::size_t count, const Workers& workers, const Run& run) {
  if (own) {
    workers.ForParts(count, [&](std::size_t index, const Workers::Part& part) {
      run(index, OwnLoops{part, part.worker()});
    });
  } else {
    for (std::size_t index = 0; index < count; ++index) run(index, SharedLoops{workers});
  }
}

// Calls run(rows, loops) for each portion.
template <class Run>
void ForPortions(const Portions& portions, const Workers& workers, const Run& run) {
  ForOwnOrShared(
      portions.cut.own, portions.cut.units.count(), workers,
      [&](std::size_t portion, const auto& loops) { run(portions.rows(portion), loops); });
}

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
  const Portions portions(plan, PortionsFor(plan, 1, context.workers));
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

// The convolution from d_y to d_x, for a stride of 1: its tiles do not overlap, and need not be
// whole images.
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
  // Adjacent rows of tiles in one image add to the same pixels.
  const Portions portions(plan, PortionsFor(plan, plan.tiles_down, context.workers));
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
  const Portions portions(plan, WeightGradPortions(plan));
  const bool own = portions.cut.own;
  const Panels groups = Panels::Parts(portions.cut.units.count(), own ? kSumGroups : 1);
  const std::size_t sums_size = WeightSumsSize(plan);
  const WinogradMemory memory(portions, groups.count() * sums_size, context);
  const WeightSumGroups sums{portions.input, DivideUp(s.out_channels, kTileColumns), memory.weights,
                             sums_size, groups.count()};
  ForOwnOrShared(own, groups.count(), context.workers, [&](std::size_t group, const auto& loops) {
    float *const inputs = memory.inputs(loops.owner), *const outputs = memory.outputs(loops.owner);
    for (std::size_t portion = groups.begin(group); portion < groups.begin(group + 1); ++portion) {
      const TileRows rows = portions.rows(portion);
      const SlotLayout in = RowLayout(portions.input, rows);
      const WinogradCorrelation product{
          sums, group, in, inputs, outputs, rows, portion > groups.begin(group)};
      const std::size_t items = OutputItems(product);
      loops.For(items + s.in_channels, [&](std::size_t index, std::size_t worker) {
        if (index < items) {
          TransformOutputRows(product, d_y, index, memory.places(worker));
        } else {
          TransformInput(plan, rows, in, x, index - items, memory.places(worker), inputs);
        }
      });
      product.Multiply(loops);
    }
  });
  const Panels channels(s.in_channels, kFinishedChannels);
  if (own) {
    context.workers.ForRanges(sums_size, kMergedValues,
                              [&](std::size_t begin, std::size_t end) { sums.Merge(begin, end); });
  }
  context.workers.For(sums.panels * channels.count(), [&](std::size_t index) {
    FinishWeightGrad(sums, index % sums.panels, channels.range(index / sums.panels), d_weight);
  });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

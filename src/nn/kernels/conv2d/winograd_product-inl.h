// SPDX-License-Identifier: Apache-2.0
// The products of winograd.h, one per slot, and the inverse transform of the weight gradient.

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/parallel.h"
#include "nn/kernels/conv2d/winograd.h"
#include "nn/kernels/conv2d/winograd_tiles-inl.h"
#include "nn/kernels/conv2d/winograd_transform-inl.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// The weights of winograd.h, transformed and packed as the row factor of each slot's
// product.

constexpr std::size_t kRowLanes = RoundUp(kTileRows, kLanes);
constexpr std::size_t kMostTaps = 25;  // of a kernel of 5 x 5

// Whether the vectors of a step never reach past the next step, which overwrites their excess:
// FillPhase relies on it. With more channels no panel is smaller.
constexpr bool StepsEndInTheNext() {
  for (std::size_t n = kLeastWinogradChannels; n < kLeastWinogradChannels + 4 * kTileRows; ++n) {
    if (2 * (n / DivideUp(n, kTileRows)) < kRowLanes) return false;
  }
  return true;
}
static_assert(StepsEndInTheNext());

struct SlotTargets {
  float* data[4][4];
};

// Taps of one phase of `rows` kernels, transformed: row r to lane r of out(slot).
template <std::size_t Ra, std::size_t Rb>
struct TransformWeights {
  // taps: tap (i, j) of the phase, kRowLanes each, lies at (i * kernel + j) * stride.
  static HWY_INLINE void Run(const WinogradPlan& plan, const float* taps, const SlotTargets& out) {
    for (std::size_t v = 0; v < kRowLanes; v += kLanes) {
      Square in, result;
      for (std::size_t i = 0; i < Ra; ++i) {
        for (std::size_t j = 0; j < Rb; ++j) {
          const std::size_t tap = (i * plan.kernel + j) * plan.stride;
          in[i][j] = hn::LoadU(Tag(), taps + tap * kRowLanes + v);
        }
      }
      Transform<WeightTransform<Ra>, WeightTransform<Rb>>(in, result);
      for (std::size_t i = 0; i <= Ra; ++i) {
        for (std::size_t j = 0; j <= Rb; ++j) {
          hn::StoreU(result[i][j], Tag(), out.data[i][j] + v);
        }
      }
    }
  }
};

// Calls f(i, j) for the slots of a phase of ra x rb taps.
template <class F>
HWY_INLINE void ForSlots(std::size_t ra, std::size_t rb, const F& f) {
  for (std::size_t i = 0; i <= ra; ++i) {
    for (std::size_t j = 0; j <= rb; ++j) f(i, j);
  }
}

// The weights passed to a convolution: its own, [O,C,U,V], or those of the one that it transposes,
// [C,O,U,V] with kernels rotated by 180 degrees.
enum class WeightsOf { kItself, kTranspose };

// The row factor of each slot's product: `rows` by `depth`, one of which is the input side. If the
// input side is the rows, a group of rows is a phase.
struct PackedWinogradWeights {
  PackedWinogradWeights(const WinogradSide& rows_side, const WinogradSide& depth_side,
                        WeightsOf weights_of = WeightsOf::kItself)
      : plan(rows_side.plan),
        rows(rows_side),
        depth(depth_side),
        of(weights_of),
        panels(rows.channels(), kTileRows) {
    std::size_t begin = 0;
    for (std::size_t slot = 0; slot < plan.slots(); ++slot) {
      base[slot] = begin;
      begin += panel_count(slot) * panel_size(slot);
    }
    total = begin;
  }
  std::size_t size() const { return total; }
  std::size_t panel_count(std::size_t slot) const { return rows.groups(slot) * panels.count(); }
  // A vector store may run past the end of its row.
  std::size_t panel_size(std::size_t slot) const {
    return depth.size(slot) * kTileRows + kRowLanes;
  }
  // Address of panel `index` of all groups, and its rows among those of the slot.
  const float* Panel(const float* packed, std::size_t slot, std::size_t index) const {
    return packed + base[slot] + index * panel_size(slot);
  }
  std::size_t RowBegin(std::size_t index) const {
    return index / panels.count() * rows.channels() + panels.begin(index % panels.count());
  }
  std::size_t RowCount(std::size_t index) const { return panels.size(index % panels.count()); }

  void Fill(const float* weight, float* packed, const Workers& workers) const {
    const Panels strips(depth.channels(), kStepsAtATime);
    workers.For(panels.count() * strips.count(), [&](std::size_t index) {
      FillStrip(weight, index / strips.count(), strips.range(index % strips.count()), packed);
    });
  }

  const WinogradPlan& plan;
  WinogradSide rows, depth;
  WeightsOf of;
  Panels panels;  // of the channels of a group
  std::array<std::size_t, kMaxSlots> base{};
  std::size_t total = 0;

 private:
  // Their taps stay in L1, and each slot is written in runs of some lines: 8 took a fifth longer,
  // 64 the same.
  static constexpr std::size_t kStepsAtATime = 32;
  // Floats between prefetching a line and writing it; 48 and 192 are no better.
  static constexpr std::size_t kAhead = 96;

  // Some steps of one panel, for one phase (a, b).
  struct Strip {
    std::size_t panel, k, steps;
    std::size_t a, b;
  };
  using Taps = float[kMostTaps * kRowLanes];  // of one step

  // Gathers the taps of some steps, then transforms their phases: a vector load of numbers just
  // stored one by one would wait for the stores.
  void FillStrip(const float* weight, std::size_t panel, Panels::Range steps, float* packed) const {
    const std::size_t area = plan.kernel * plan.kernel;
    const bool by_rows = rows.input == (of == WeightsOf::kTranspose);  // else by steps
    const std::size_t row_stride = by_rows ? depth.channels() * area : area;
    const std::size_t k_stride = by_rows ? area : rows.channels() * area;
    const float* first = weight + panels.begin(panel) * row_stride;
    Taps taps[kStepsAtATime] = {};
    for (std::size_t k = steps.begin; k < steps.end; ++k) {
      TransposeStrip(first + k * k_stride, row_stride, panels.size(panel), area,
                     taps[k - steps.begin], kRowLanes);
    }
    for (std::size_t a = 0; a < plan.stride; ++a) {
      for (std::size_t b = 0; b < plan.stride; ++b)
        FillPhase({panel, steps.begin, steps.end - steps.begin, a, b}, taps, packed);
    }
  }

  void FillPhase(const Strip& strip, const Taps* taps, float* packed) const {
    const std::size_t ra = plan.taps(strip.a), rb = plan.taps(strip.b);
    const std::size_t count = panels.size(strip.panel);
    const std::size_t first = (strip.a * plan.kernel + strip.b) * kRowLanes;  // tap of the phase
    SlotTargets to;
    ForSlots(ra, rb,
             [&](std::size_t i, std::size_t j) { to.data[i][j] = packed + At(strip, i, j); });
    // What a store writes past its row, the next step overwrites; after the last step comes another
    // strip or phase, which may be written already.
    for (std::size_t k = 0; k + 1 < strip.steps; ++k) {
      ForTaps<TransformWeights>(ra, rb, plan, taps[k] + first, to);
      ForSlots(ra, rb, [&](std::size_t i, std::size_t j) HWY_ATTR {
        to.data[i][j] += count;
        PrefetchLineToWrite(to.data[i][j] + kAhead);
      });
    }
    float lanes[4][4][kRowLanes];
    SlotTargets whole;
    ForSlots(ra, rb, [&](std::size_t i, std::size_t j) { whole.data[i][j] = lanes[i][j]; });
    ForTaps<TransformWeights>(ra, rb, plan, taps[strip.steps - 1] + first, whole);
    ForSlots(ra, rb,
             [&](std::size_t i, std::size_t j) { std::copy_n(lanes[i][j], count, to.data[i][j]); });
  }

  // The slot at which reversed taps have the value that taps have at slot i: 0 and infinity swap.
  std::size_t SlotOf(std::size_t i) const {
    return of == WeightsOf::kTranspose && i % 2 == 0 ? 2 - i : i;
  }

  // Offset of the strip's values of slot (i, j).
  std::size_t At(const Strip& strip, std::size_t i, std::size_t j) const {
    const std::size_t slot = SlotOf(i) * plan.axis_slots + SlotOf(j);
    const std::size_t phase = plan.phase_index(slot, strip.a, strip.b);
    const std::size_t group = rows.input ? phase : 0;
    const std::size_t k = strip.k + (rows.input ? 0 : phase * depth.channels());
    return base[slot] + (group * panels.count() + strip.panel) * panel_size(slot) +
           k * panels.size(strip.panel);
  }
};

constexpr std::size_t kSlotDepth = 256;         // steps of k in one pass: half of L1
constexpr std::size_t kSlotRowPanels = 21;      // per work item: 126 rows
constexpr std::size_t kSlotColumnPanels = 16;   // per work item: 256 tiles
constexpr std::size_t kSlotItemsPerWorker = 3;  // with many workers, at least
constexpr std::size_t kFewSlotPanels = 4;       // columns, or twice as many rows: no smaller items

constexpr std::size_t kManySlotRowPanels = 7;  // per work item with more workers: 42 rows

// ---- Forward and input gradient: out[slot] = weights[slot] in[slot] ----

struct SlotProduct {
  const PackedWinogradWeights& weights;
  const float* packed;
  const SlotLayout& in_layout;  // PanelLayout of the depth's side
  const float* in;
  const SlotLayout& out_layout;  // RowLayout of the rows' side
  float* out;
  const TileRows& rows;
};

struct SlotItem {
  std::size_t slot;
  std::size_t row_begin, row_end;        // row panels
  std::size_t column_begin, column_end;  // column panels
};

inline void MultiplyItem(const SlotProduct& p, const SlotItem& item) {
  const std::size_t depth = p.weights.depth.size(item.slot);
  for (std::size_t k = 0; k < depth; k += kSlotDepth) {
    const std::size_t steps = std::min(kSlotDepth, depth - k);
    for (std::size_t column = item.column_begin; column < item.column_end; ++column) {
      const PackedColumns columns{p.in + p.in_layout.At(item.slot, k, column)};
      for (std::size_t panel = item.row_begin; panel < item.row_end; ++panel) {
        const std::size_t count = p.weights.RowCount(panel);
        const TileTarget target{
            .c = p.out + p.out_layout.At(item.slot, p.weights.RowBegin(panel), column),
            .ldc = p.out_layout.index_stride,
            .offset = {0, kLanes},
            .count = {kLanes, kLanes},
            .accumulate = k > 0};
        PackedRowsTile(p.weights.Panel(p.packed, item.slot, panel) + k * count, count, columns,
                       steps, target);
      }
    }
  }
}

// The work items of a product. Each result is computed alike, whatever the items.
struct SlotItems {
  SlotItems(const SlotProduct& product, std::size_t workers) : p(product) {
    while (workers > kFewWorkers && count() < kSlotItemsPerWorker * workers && Halve()) {
    }
  }
  Panels columns() const { return {p.rows.padded / kTileColumns, column_panels}; }
  Panels blocks(std::size_t slot) const { return {p.weights.panel_count(slot), row_panels}; }
  std::size_t most_blocks() const {
    std::size_t most = 0;
    for (std::size_t slot = 0; slot < p.weights.plan.slots(); ++slot)
      most = std::max(most, blocks(slot).count());
    return most;
  }
  std::size_t count() const { return p.weights.plan.slots() * most_blocks() * columns().count(); }
  // The longer side; false if both are short.
  bool Halve() {
    const std::size_t rows = std::min(row_panels, p.weights.panel_count(0));
    const std::size_t wide = columns().largest();
    if (std::max(2 * rows, wide) <= kFewSlotPanels) return false;
    (2 * rows > wide ? row_panels : column_panels) = DivideUp(2 * rows > wide ? rows : wide, 2);
    return true;
  }

  const SlotProduct& p;
  std::size_t row_panels = kSlotRowPanels, column_panels = kSlotColumnPanels;
};

// loops: as in winograd-inl.h.
template <class Loops>
void MultiplySlots(const SlotProduct& p, const Loops& loops) {
  const SlotItems items(p, loops.workers_sharing());
  const Panels columns = items.columns();
  const std::size_t most = items.most_blocks();
  loops.For(items.count(), [&](std::size_t index) {
    const std::size_t slot = index / (most * columns.count());
    const std::size_t block = index / columns.count() % most, column = index % columns.count();
    const Panels blocks = items.blocks(slot);
    if (block >= blocks.count()) return;
    MultiplyItem(p, {slot, blocks.begin(block), blocks.begin(block) + blocks.size(block),
                     columns.begin(column), columns.begin(column) + columns.size(column)});
  });
}

// ---- Weight gradient: sums[slot] (+)= inputs[slot] outputs[slot]^T ----

template <std::size_t R = kTileRows>
HWY_INLINE void PlainRowsTile(const float* rows, std::size_t row_stride, std::size_t count,
                              PackedColumns columns, std::size_t steps, const TileTarget& target) {
  if (count == R) {
    PlainRows<R> factor;
    for (std::size_t r = 0; r < R; ++r) factor.data[r] = rows + r * row_stride;
    RunTile(factor, columns, steps, target);
  } else if constexpr (R > 1) {
    PlainRowsTile<R - 1>(rows, row_stride, count, columns, steps, target);
  }
}

// The sums of some groups of portions, to be added up in order.
struct WeightSumGroups {
  const WinogradSide& input;
  std::size_t panels;  // of output channels
  float* data;  // [group][slot][panel of output channels][index of the input's side][kTileColumns]
  std::size_t group_stride, groups;

  float* At(std::size_t group, std::size_t slot, std::size_t panel, std::size_t index) const {
    return data + group * group_stride +
           (input.before(slot) * panels + panel * input.size(slot) + index) * kTileColumns;
  }

  // Adds the other groups' sums [begin, end), whole vectors, to the first's, in order.
  void Merge(std::size_t begin, std::size_t end) const {
    for (std::size_t group = 1; group < groups; ++group) {
      const float* from = data + group * group_stride;
      for (std::size_t i = begin; i < end; i += kLanes) {
        const Vec sum = hn::Add(hn::LoadU(Tag(), data + i), hn::LoadU(Tag(), from + i));
        hn::StoreU(sum, Tag(), data + i);
      }
    }
  }
};

struct WinogradCorrelation {
  const WeightSumGroups& sums;
  std::size_t group;
  const SlotLayout& in_layout;  // RowLayout
  const float* inputs;
  float* outputs;  // [slot][panel of output channels][tile][kTileColumns]
  const TileRows& rows;
  bool accumulate;

  std::size_t OutputAt(std::size_t slot, std::size_t panel) const {
    return (slot * sums.panels + panel) * rows.pitch * kTileColumns;
  }

  // Work items: some rows of a slot with all panels or, with many workers, fewer rows with one
  // panel.
  template <class Loops>
  void Multiply(const Loops& loops) const {
    const WinogradSide& input = sums.input;
    const bool many = loops.workers_sharing() > kFewWorkers;
    const std::size_t item_rows = (many ? kManySlotRowPanels : kSlotRowPanels) * kTileRows;
    const std::size_t item_panels = many ? 1 : sums.panels, groups = sums.panels / item_panels;
    std::size_t most = 0;
    for (std::size_t slot = 0; slot < input.plan.slots(); ++slot) {
      most = std::max(most, DivideUp(input.size(slot), item_rows));
    }
    loops.For(input.plan.slots() * most * groups, [&](std::size_t index) {
      const std::size_t slot = index / groups / most, block = index / groups % most;
      const std::size_t panel = index % groups * item_panels;
      const Panels blocks(input.size(slot), item_rows);
      if (block >= blocks.count()) return;
      const Panels::Range some = blocks.range(block);
      MultiplyRows(slot, some, {panel, panel + item_panels});
    });
  }

 private:
  void MultiplyRows(std::size_t slot, Panels::Range some, Panels::Range of_panels) const {
    const Panels row_panels(some.end - some.begin, kTileRows);
    for (std::size_t t = 0; t < rows.tiles; t += kSlotDepth) {
      const std::size_t steps = std::min(kSlotDepth, rows.tiles - t);
      for (std::size_t panel = of_panels.begin; panel < of_panels.end; ++panel) {
        const PackedColumns columns{outputs + OutputAt(slot, panel) + t * kTileColumns};
        for (std::size_t i = 0; i < row_panels.count(); ++i) {
          const std::size_t row = some.begin + row_panels.begin(i);
          PlainRowsTile(inputs + in_layout.At(slot, row, 0) + t, in_layout.index_stride,
                        row_panels.size(i), columns, steps,
                        {.c = sums.At(group, slot, panel, row),
                         .ldc = kTileColumns,
                         .offset = {0, kLanes},
                         .count = {kLanes, kLanes},
                         .accumulate = accumulate || t > 0});
        }
      }
    }
  }
};

// Work items: a few rows of tiles of one panel of output channels, since layers with few channels
// have a single panel, which would keep only one worker busy.
constexpr std::size_t kOutputRows = 8;

inline std::size_t OutputItems(const WinogradCorrelation& product) {
  return product.sums.panels * DivideUp(product.rows.count, kOutputRows);
}

// The values of one item. memory: for one row of tiles, all channels.
inline void TransformOutputRows(const WinogradCorrelation& product, const float* d_y,
                                std::size_t item, float* memory) {
  const WinogradPlan& plan = product.sums.input.plan;
  const std::size_t slot_stride = product.OutputAt(1, 0), panels = product.sums.panels;
  const std::size_t panel = item % panels, first = item / panels * kOutputRows;
  for (std::size_t r = first; r < std::min(first + kOutputRows, product.rows.count); ++r) {
    GatherChannels(plan, TileRow(plan, product.rows.first + r), d_y, panel * kTileColumns, memory);
    float* values =
        product.outputs + product.OutputAt(0, panel) + r * plan.tiles_across * kTileColumns;
    if (plan.axis_slots == 4) {
      TransformChannels<4>(plan, memory, slot_stride, values);
    } else {
      TransformChannels<3>(plan, memory, slot_stride, values);
    }
  }
}

struct WeightSums {
  const float* data[4][4];
};

template <std::size_t Ra, std::size_t Rb>
struct TransformWeightsBack {
  // taps: tap (i, j) of the phase, kTileColumns lanes each, lies at (i * kernel + j) * stride.
  static HWY_INLINE void Run(const WeightSums& sums, std::size_t channel, const WinogradPlan& plan,
                             float* taps) {
    for (std::size_t v = 0; v < kTileColumns; v += kLanes) {
      const std::size_t at = channel * kTileColumns + v;
      Square in, out;
      for (std::size_t i = 0; i <= Ra; ++i) {
        for (std::size_t j = 0; j <= Rb; ++j) in[i][j] = hn::LoadU(Tag(), sums.data[i][j] + at);
      }
      Transform<WeightAdjoint<Ra>, WeightAdjoint<Rb>>(in, out);
      for (std::size_t i = 0; i < Ra; ++i) {
        for (std::size_t j = 0; j < Rb; ++j) {
          const std::size_t tap = (i * plan.kernel + j) * plan.stride;
          hn::StoreU(out[i][j], Tag(), taps + tap * kTileColumns + v);
        }
      }
    }
  }
};

// The sums of phase (a, b) between input channel 0 and one panel of output channels.
inline WeightSums SumsOfPhase(const WeightSumGroups& sums, std::size_t panel, std::size_t a,
                              std::size_t b) {
  const WinogradPlan& plan = sums.input.plan;
  WeightSums from;
  for (std::size_t i = 0; i <= plan.taps(a); ++i) {
    for (std::size_t j = 0; j <= plan.taps(b); ++j) {
      const std::size_t slot = i * plan.axis_slots + j;
      const std::size_t index = plan.phase_index(slot, a, b) * sums.input.channels();
      from.data[i][j] = sums.At(0, slot, panel, index);
    }
  }
  return from;
}

// Per work item: input channels, and sums of a group (16 KB, half of L1).
constexpr std::size_t kFinishedChannels = 8;
constexpr std::size_t kMergedValues = 4096;

// Finishes some input channels of the first group's sums.
inline void FinishWeightGrad(const WeightSumGroups& groups, std::size_t panel, Panels::Range some,
                             float* d_weight) {
  const WinogradPlan& plan = groups.input.plan;
  const std::size_t area = plan.kernel * plan.kernel, first = panel * kTileColumns;
  const std::size_t in_channels = plan.s.in_channels;
  const std::size_t channels = std::min(kTileColumns, plan.s.out_channels - first);
  WeightSums sums[4];  // stride <= 2
  for (std::size_t a = 0; a < plan.stride; ++a) {
    for (std::size_t b = 0; b < plan.stride; ++b) {
      sums[a * plan.stride + b] = SumsOfPhase(groups, panel, a, b);
    }
  }
  float taps[kMostTaps * kTileColumns];
  for (std::size_t c = some.begin; c < some.end; ++c) {
    for (std::size_t a = 0; a < plan.stride; ++a) {
      for (std::size_t b = 0; b < plan.stride; ++b) {
        ForTaps<TransformWeightsBack>(plan.taps(a), plan.taps(b), sums[a * plan.stride + b], c,
                                      plan, taps + (a * plan.kernel + b) * kTileColumns);
      }
    }
    TransposeStrip(taps, kTileColumns, area, channels, d_weight + (first * in_channels + c) * area,
                   in_channels * area);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

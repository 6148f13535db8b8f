// SPDX-License-Identifier: Apache-2.0
// Matrix product, blocked after Goto and van de Geijn: Anatomy of high-performance matrix
// multiplication, ACM TOMS 34(3), 2008. A is packed once for all work items; each packs the slice
// of B that it needs, in blocks that stay in L2. A panel of A stays in L1 while the panels of that
// block stream past.

#if defined(TILEGRAD_NN_KERNELS_GEMM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_GEMM_INL_H_
#undef TILEGRAD_NN_KERNELS_GEMM_INL_H_
#else
#define TILEGRAD_NN_KERNELS_GEMM_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "nn/kernels/gemm.h"
#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Packs the large operand of a matrix product, a block of columns and steps at a time. With few
// rows on the other side (a training batch), copying it with its cache misses would cost as much as
// multiplying. So the tiles of the previous block pack a B that is not transposed, a row of a panel
// every few steps. A transposed B is packed a whole block at a time, in runs as long as the block
// is deep, prefetched by the tiles of the previous block.

// Stride between packed panels. The extra line keeps panels out of each other's cache sets while a
// row is written to all of them.
constexpr std::size_t PackedPanelStride(std::size_t steps) {
  return kTileColumns * steps + kLineFloats;
}

// Columns [begin, end) and steps [k, k + steps) of B, packed: panels of kTileColumns, zero-padded
// after the last column.
struct ColumnBlock {
  std::size_t begin = 0, end = 0;
  std::size_t k = 0, steps = 0;

  std::size_t panels() const { return DivideUp(end - begin, kTileColumns); }
};

// Copies the whole panels of a block, one row of a panel at a time, going through B row by row:
// reads are contiguous and prefetched.
class PanelCopier {
 public:
  // b: the block in B, rows `ld` apart. Copies `share` rows of a panel in one run.
  PanelCopier(const float* b, std::size_t ld, const ColumnBlock& block, float* packed,
              std::size_t share)
      : from_(b),
        to_(packed),
        panels_((block.end - block.begin) / kTileColumns),
        rows_left_(panels_ == 0 ? 0 : block.steps),
        share_(share) {
    if (rows_left_ == 0) return;
    ahead_ = DivideUp(kAhead * share, panels_) * ld;
    next_panel_ = static_cast<std::ptrdiff_t>(PackedPanelStride(block.steps));
    next_row_from_ = ld - (panels_ - 1) * kTileColumns;
    const auto panels_back = static_cast<std::ptrdiff_t>(panels_ - 1);
    next_row_to_ = static_cast<std::ptrdiff_t>(kTileColumns) - panels_back * next_panel_;
  }

  HWY_INLINE void Run() {
    for (std::size_t i = 0; i < share_ && rows_left_ > 0; ++i) Copy();
  }
  void Finish() {
    while (rows_left_ > 0) Copy();
  }

 private:
  // Prefetch distance in rows of panels: the best of 16 to 256 for lines past L1.
  static constexpr std::size_t kAhead = 64;

  HWY_INLINE void Copy() {
    for (std::size_t v = 0; v < kTileColumns; v += kLineFloats) {
      PrefetchLineToL2(from_ + ahead_ + v);
    }
    for (std::size_t v = 0; v < kTileColumns; v += kLanes) {
      hn::StoreU(hn::LoadU(Tag(), from_ + v), Tag(), to_ + v);
    }
    if (++panel_ < panels_) {
      from_ += kTileColumns;
      to_ += next_panel_;
    } else {
      from_ += next_row_from_;
      to_ += next_row_to_;
      panel_ = 0;
      --rows_left_;
    }
  }

  const float* from_;
  float* to_;
  std::size_t panel_ = 0, panels_, rows_left_, share_;
  std::size_t ahead_ = 0, next_row_from_ = 0;
  std::ptrdiff_t next_panel_ = 0, next_row_to_ = 0;
};

// Prefetches the lines of a block of a transposed B, some per run.
class BlockFetcher {
 public:
  // b: the block in B^T, `rows` runs of `steps` floats, `ld` apart. Prefetches `share` lines per
  // run.
  BlockFetcher(const float* b, std::size_t ld, std::size_t rows, std::size_t steps,
               std::size_t share)
      : row_(b), ld_(ld), rows_left_(rows), steps_(steps), share_(share) {}

  HWY_INLINE void Run() {
    for (std::size_t i = 0; i < share_ && rows_left_ > 0; ++i) {
      PrefetchLineToL2(row_ + at_);
      at_ += kLineFloats;
      if (at_ >= steps_) {
        at_ = 0;
        row_ += ld_;
        --rows_left_;
      }
    }
  }

 private:
  const float* row_;
  std::size_t ld_, rows_left_, steps_, share_, at_ = 0;
};

// Packs one block of B.
class ColumnPacker {
 public:
  ColumnPacker(const GemmProblem<float>& problem, const ColumnBlock& block, float* packed)
      : p_(problem), block_(block), packed_(packed) {}

  const ColumnBlock& block() const { return block_; }
  const float* panel(std::size_t i) const { return packed_ + i * PackedPanelStride(block_.steps); }

  // All at once. Not inlined, or the sums of the caller's tiles would not stay in registers.
  HWY_NOINLINE void Pack() const {
    if (p_.transpose_b) {
      for (std::size_t panel = 0; panel < block_.panels(); ++panel) PackPanel(panel);
    } else {
      Copier(block_.steps * block_.panels()).Finish();
      PackRest();
    }
  }

  // For a B that is not transposed: packs all but a narrower last panel in `runs` runs.
  PanelCopier Copier(std::size_t runs) const {
    return PanelCopier(RowOf(0), p_.ldb, block_, packed_,
                       DivideUp(block_.steps * whole_panels(), runs));
  }
  // For a transposed B: prefetches the block in `runs` runs.
  BlockFetcher Fetcher(std::size_t runs) const {
    const std::size_t columns = block_.end - block_.begin;
    return BlockFetcher(p_.b + block_.begin * p_.ldb + block_.k, p_.ldb, columns, block_.steps,
                        DivideUp(columns * DivideUp(block_.steps, kLineFloats), runs));
  }
  // The last panel, if it is narrower.
  HWY_NOINLINE void PackRest() const {
    const std::size_t column = whole_panels() * kTileColumns;
    const std::size_t rest = block_.end - block_.begin - column;
    if (rest == 0) return;
    float* out = packed_ + whole_panels() * PackedPanelStride(block_.steps);
    for (std::size_t k = 0; k < block_.steps; ++k, out += kTileColumns) {
      std::fill(std::copy_n(RowOf(k) + column, rest, out), out + kTileColumns, 0.0f);
    }
  }

 private:
  std::size_t whole_panels() const { return (block_.end - block_.begin) / kTileColumns; }
  const float* RowOf(std::size_t k) const { return p_.b + (block_.k + k) * p_.ldb + block_.begin; }

  void PackPanel(std::size_t panel) const {
    const std::size_t column = block_.begin + panel * kTileColumns;
    const std::size_t columns = std::min(kTileColumns, block_.end - column);
    float* out = packed_ + panel * PackedPanelStride(block_.steps);
    if (columns < kTileColumns) std::fill_n(out, kTileColumns * block_.steps, 0.0f);
    TransposeStrip(p_.b + column * p_.ldb + block_.k, p_.ldb, columns, block_.steps, out,
                   kTileColumns);
  }

  const GemmProblem<float>& p_;
  ColumnBlock block_;
  float* packed_;
};

// Steps of k in one block, for which C is read and written once. With vectors of 16 floats a tile
// is so large that panels of B need not stay in L1, and deeper blocks are faster.
constexpr std::size_t kDepth = kLanes > 8 ? 512 : 256;  // the best of 128 to 512 there
constexpr std::size_t kBlockFloats = 65536;  // of B per block; the next block shares L2 with it
constexpr std::size_t kBlockPanels = kBlockFloats / (kDepth * kTileColumns);
// For a transposed B, in memory and packed: both stay in L2.
constexpr std::size_t kFetchedPanels = std::max<std::size_t>(64 / kTileColumns, kLanes > 8 ? 2 : 4);
constexpr std::size_t kItemRows = 4096;  // many: each work item packs its own columns of B
constexpr std::size_t kPackedFloats = std::size_t{2} << 20;  // of A packed at a time, about

// Division of C into work items. The sum of an element does not depend on it, so it may depend on
// the number of workers: with several, some eight items each, first narrower, then shorter.
struct GemmItems {
  std::size_t rows, columns;
};

constexpr std::size_t kLeastRows = 128;  // of an item, or packing B would dominate

// The fewest columns of an item. Each item streams all rows of A: if these are few and B is read
// row by row, as many columns as a block has, provided every worker gets some. Many workers take
// narrow items rather than none: a layer of 384 outputs has three wide ones.
inline std::size_t LeastColumns(const GemmProblem<float>& p, std::size_t workers) {
  const std::size_t least = (workers > kFewWorkers ? 1 : 4) * kTileColumns;
  if (p.transpose_b || p.m > kLeastRows) return least;
  return std::max(least, std::min(kBlockPanels * kTileColumns, p.n / workers));
}

inline GemmItems ItemsFor(const GemmProblem<float>& p, std::size_t workers) {
  const std::size_t wanted = workers > 1 ? 8 * workers : 1;
  const std::size_t columns =
      RoundUp(std::max(DivideUp(p.n, wanted), LeastColumns(p, workers)), kTileColumns);
  const std::size_t parts = DivideUp(wanted, DivideUp(p.n, columns));
  return {std::clamp(DivideUp(p.m, parts), std::min(p.m, kLeastRows), kItemRows), columns};
}

struct GemmPlan {
  GemmPlan(const GemmProblem<float>& problem, const GemmItems& items)
      : p(problem),
        rows(p.m, kTileRows),
        row_blocks(rows.count(), DivideUp(items.rows, kTileRows)),
        column_blocks(DivideUp(p.n, kTileColumns), items.columns / kTileColumns),
        depths(p.k, kDepth),
        passes(depths.count(), std::max<std::size_t>(1, kPackedFloats / p.m / kDepth)) {}

  std::size_t items() const { return row_blocks.count() * column_blocks.count(); }
  // Column block `block`, all steps.
  ColumnBlock Columns(std::size_t block) const {
    const auto [begin, end] = column_blocks.range(block);
    return {begin * kTileColumns, std::min(p.n, end * kTileColumns), 0, p.k};
  }
  std::size_t packed_a_size() const { return p.m * passes.largest() * depths.largest(); }
  // The fewer steps, the more columns: a panel of A streams past once per block.
  std::size_t block_panels() const {
    return p.transpose_b ? kFetchedPanels : kBlockPanels * (kDepth / depths.largest());
  }
  std::size_t packed_b_size() const {
    return std::min(column_blocks.largest(), block_panels()) * PackedPanelStride(depths.largest());
  }
  // Per worker: the current columns and the next.
  std::size_t worker_size() const { return RoundUp(2 * packed_b_size(), kAlignment); }

  GemmProblem<float> p;
  Panels rows;           // panels of A
  Panels row_blocks;     // of those panels
  Panels column_blocks;  // of column panels
  Panels depths;         // blocks of steps
  Panels passes;         // of those blocks: A is packed for one pass at a time
};

// Packs row panel `panel` of A for depth blocks [depth, end), in sequence, each of all panels.
inline void PackRowPanel(const GemmPlan& plan, std::size_t panel, std::size_t depth,
                         std::size_t end, float* packed) {
  const GemmProblem<float>& p = plan.p;
  const std::size_t row = plan.rows.begin(panel), rows = plan.rows.size(panel);
  const std::size_t k0 = plan.depths.begin(depth);
  for (std::size_t d = depth; d < end; ++d) {
    const std::size_t k = plan.depths.begin(d), steps = plan.depths.size(d);
    PackStrip({p.a, p.lda, p.transpose_a}, row, rows, k, steps,
              packed + p.m * (k - k0) + row * steps, rows);
  }
}

inline TileTarget TargetOf(const GemmProblem<float>& p, std::size_t row, std::size_t column,
                           bool first) {
  const std::size_t columns = std::min(kTileColumns, p.n - column);
  TileTarget t{.c = p.c + row * p.ldc + column,
               .ldc = p.ldc,
               .offset = {0, kLanes},
               .count = {std::min(columns, kLanes), columns - std::min(columns, kLanes)}};
  if (first && p.bias != nullptr) t.column_bias = p.bias + column;
  t.accumulate = p.accumulate || !first;
  return t;
}

// A tile of C: row panel `panel`, column panel `j` of the block.
template <class Columns>
HWY_INLINE void MultiplyTile(const GemmPlan& plan, const float* packed_a, std::size_t panel,
                             const ColumnBlock& block, std::size_t j, Columns columns) {
  const std::size_t row = plan.rows.begin(panel);
  PackedRowsTile(packed_a + row * block.steps, plan.rows.size(panel), columns, block.steps,
                 TargetOf(plan.p, row, block.begin + j * kTileColumns, block.k == 0));
}

// Runs `tile(panel, j)` for row panels [first, first + rows) and all column panels j of a block.
template <class F>
HWY_INLINE void ForTiles(std::size_t first, std::size_t rows, const ColumnBlock& block,
                         const F& tile) {
  for (std::size_t panel = first; panel < first + rows; ++panel) {
    for (std::size_t j = 0; j < block.panels(); ++j) tile(panel, j);
  }
}

// The tiles of `rows` row panels from `first` on with the packed columns. Like the next one, a
// separate function: within a large caller GCC 12 does not keep a tile's sums in registers.
inline HWY_NOINLINE void MultiplyBlock(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                       const float* packed_a, const ColumnPacker& columns) {
  ForTiles(first, rows, columns.block(), [&](std::size_t panel, std::size_t j) HWY_ATTR {
    MultiplyTile(plan, packed_a, panel, columns.block(), j, PackedColumns{columns.panel(j)});
  });
}

// The same, with a task interleaved.
template <class Task>
HWY_INLINE void MultiplyWithTask(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                 const float* packed_a, const ColumnPacker& columns, Task& task) {
  ForTiles(first, rows, columns.block(), [&](std::size_t panel, std::size_t j) HWY_ATTR {
    MultiplyTile(plan, packed_a, panel, columns.block(), j,
                 BusyColumns<Task>(columns.panel(j), task));
  });
}

// Number of task runs: at least 1.
inline std::size_t TaskRuns(std::size_t rows, const ColumnBlock& block) {
  return std::max<std::size_t>(1, rows * block.panels() * (block.steps / kRunSteps));
}

// The same; the tiles also pack `next`.
inline HWY_NOINLINE void MultiplyAndPack(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                         const float* packed_a, const ColumnPacker& columns,
                                         const ColumnPacker& next) {
  PanelCopier copier = next.Copier(TaskRuns(rows, columns.block()));
  MultiplyWithTask(plan, first, rows, packed_a, columns, copier);
  copier.Finish();
  next.PackRest();
}

// The same; the tiles also prefetch `next`, of a transposed B.
inline HWY_NOINLINE void MultiplyAndFetch(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                          const float* packed_a, const ColumnPacker& columns,
                                          const ColumnPacker& next) {
  BlockFetcher fetcher = next.Fetcher(TaskRuns(rows, columns.block()));
  MultiplyWithTask(plan, first, rows, packed_a, columns, fetcher);
}

// The blocks of B that a work item processes, in memory order: all columns of a depth, the order of
// the rows of B, or all depths of some columns, the order of a transposed B.
class BlockOrder {
 public:
  // Depth blocks [depth, end) of the plan's column block `columns`.
  BlockOrder(const GemmPlan& plan, std::size_t columns, std::size_t depth, std::size_t end)
      : plan_(plan),
        first_panel_(plan.column_blocks.begin(columns)),
        depth_(depth),
        depths_(end - depth),
        blocks_(plan.column_blocks.size(columns), plan.block_panels()) {}

  std::size_t count() const { return blocks_.count() * depths_; }
  ColumnBlock At(std::size_t i) const {
    const bool depth_first = plan_.p.transpose_b;
    const std::size_t d = depth_ + (depth_first ? i % depths_ : i / blocks_.count());
    const std::size_t block = depth_first ? i / depths_ : i % blocks_.count();
    const std::size_t begin = (first_panel_ + blocks_.begin(block)) * kTileColumns;
    return {.begin = begin,
            .end = std::min(plan_.p.n, begin + blocks_.size(block) * kTileColumns),
            .k = plan_.depths.begin(d),
            .steps = plan_.depths.size(d)};
  }

 private:
  const GemmPlan& plan_;
  std::size_t first_panel_, depth_, depths_;
  Panels blocks_;
};

// Work item: one block of rows by one block of columns, the steps of depth blocks [depth, end).
// packed_b: plan.worker_size() floats.
inline void MultiplyItem(const GemmPlan& plan, std::size_t item, std::size_t depth, std::size_t end,
                         const float* packed_a, float* packed_b) {
  const std::size_t rows = item % plan.row_blocks.count();
  const std::size_t panel = plan.row_blocks.begin(rows), panels = plan.row_blocks.size(rows);
  const BlockOrder order(plan, item / plan.row_blocks.count(), depth, end);
  const auto packer = [&](std::size_t i) {
    return ColumnPacker(plan.p, order.At(i), packed_b + i % 2 * plan.packed_b_size());
  };
  const bool transposed = plan.p.transpose_b;
  for (std::size_t i = 0; i < order.count(); ++i) {
    const ColumnPacker present = packer(i);
    const float* a = packed_a + plan.p.m * (present.block().k - plan.depths.begin(depth));
    if (i == 0 || transposed) present.Pack();
    if (i + 1 == order.count()) {
      MultiplyBlock(plan, panel, panels, a, present);
    } else if (transposed) {
      MultiplyAndFetch(plan, panel, panels, a, present, packer(i + 1));
    } else {
      MultiplyAndPack(plan, panel, panels, a, present, packer(i + 1));
    }
  }
}

// Row panels of A per task: one worker packs a small A before others would have joined.
inline std::size_t PackedPanels(const GemmPlan& plan) {
  constexpr std::size_t kAlone = 16384;  // floats
  return plan.packed_a_size() < kAlone ? std::max<std::size_t>(1, plan.rows.count()) : 1;
}

inline void GemmTarget(const GemmProblem<float>& problem, const KernelContext& context) {
  const auto workers = context.workers.size();
  const GemmPlan plan(problem, ItemsFor(problem, workers));
  const std::size_t a_size = RoundUp(plan.packed_a_size(), kAlignment);
  float* packed_a = context.scratch.Floats(a_size + plan.worker_size() * workers);
  for (std::size_t pass = 0; pass < plan.passes.count(); ++pass) {
    const std::size_t depth = plan.passes.begin(pass), end = depth + plan.passes.size(pass);
    ForChunks(&context.workers, plan.rows.count(), PackedPanels(plan),
              [&](std::size_t first, std::size_t last) HWY_ATTR {
                for (std::size_t panel = first; panel < last; ++panel)
                  PackRowPanel(plan, panel, depth, end, packed_a);
              });
    context.workers.For(plan.items(), [&](std::size_t item, std::size_t worker) {
      MultiplyItem(plan, item, depth, end, packed_a,
                   packed_a + a_size + worker * plan.worker_size());
    });
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

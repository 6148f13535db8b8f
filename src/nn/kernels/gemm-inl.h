// SPDX-License-Identifier: Apache-2.0
// Matrix product, blocked after Goto and van de Geijn: Anatomy of high-performance matrix
// multiplication, ACM TOMS 34(3), 2008. A is packed once for all; every work item packs the slice
// of B that it needs and keeps a panel of it in L1 while panels of A stream past from L2.

#if defined(TILEGRAD_NN_KERNELS_GEMM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_GEMM_INL_H_
#undef TILEGRAD_NN_KERNELS_GEMM_INL_H_
#else
#define TILEGRAD_NN_KERNELS_GEMM_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/gemm.h"
#include "nn/kernels/gemm_columns-inl.h"
#include "nn/kernels/micro_kernel-inl.h"
#include "nn/kernels/pack-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kDepth = 256;        // steps of k in one pass: a B panel takes half of L1
constexpr std::size_t kItemColumns = 256;  // of C in one work item, at most: the best of 128 to 512
constexpr std::size_t kItemRows = 4096;    // many: each work item packs its columns of B for itself
constexpr std::size_t kPackedRows = 4;     // of B between two tiles: L1 holds what waits for it
constexpr std::size_t kPackedFloats = std::size_t{2} << 20;  // of A packed at a time, about

// How C is cut into work items. The sum of an element does not depend on it, so it may depend on
// the number of workers: with several, some four items for each, narrower first, then shorter.
struct GemmItems {
  GemmItems(std::size_t m, std::size_t n, std::size_t workers) {
    const std::size_t wanted = workers > 1 ? 4 * workers : 1;
    columns = std::clamp(RoundUp(DivideUp(n, wanted), kTileColumns), 4 * kTileColumns,
                         std::max(kItemColumns, 4 * kTileColumns));
    const std::size_t parts = DivideUp(wanted, DivideUp(n, columns));
    rows = std::clamp(DivideUp(m, parts), std::min(m, kLeastRows), kItemRows);
  }
  static constexpr std::size_t kLeastRows = 128;  // or packing B would weigh too much
  std::size_t rows, columns;
};

struct GemmPlan {
  GemmPlan(const GemmProblem<float>& problem, const GemmItems& items)
      : p(problem),
        rows(p.m, kTileRows),
        row_blocks(rows.count(), DivideUp(items.rows, kTileRows)),
        column_blocks(DivideUp(p.n, kTileColumns), items.columns / kTileColumns),
        depths(p.k, kDepth),
        passes(depths.count(), std::max<std::size_t>(1, kPackedFloats / p.m / kDepth)) {}

  std::size_t packed_a_size() const { return p.m * passes.largest() * depths.largest(); }
  std::size_t packed_b_size() const {
    return column_blocks.largest() * PackedPanelStride(depths.largest());
  }
  // Of a worker: the columns in use and the next ones.
  std::size_t worker_size() const { return RoundUp(2 * packed_b_size(), kAlignment); }

  GemmProblem<float> p;
  Panels rows;           // panels of A
  Panels row_blocks;     // of those panels
  Panels column_blocks;  // of column panels
  Panels depths;         // blocks of steps
  Panels passes;         // of those blocks: A is packed for one pass at a time
};

// Packs row panel `panel` of A for depth blocks [depth, end), one after the other, each of all
// panels.
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

// The tiles of `rows` row panels from `first` on and of the packed columns. Like the next one a
// function of its own: within a large caller GCC 12 does not keep a tile's sums in registers.
HWY_NOINLINE void MultiplyBlock(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                const float* packed_a, const ColumnPacker& columns) {
  for (std::size_t j = 0; j < columns.block().panels(); ++j) {
    for (std::size_t panel = first; panel < first + rows; ++panel) {
      MultiplyTile(plan, packed_a, panel, columns.block(), j, PackedColumns{columns.panel(j)});
    }
  }
}

// The same; meanwhile `next` is packed: fetched by the tiles, and copied as soon as a few of its
// rows are there.
HWY_NOINLINE void MultiplyAndPack(const GemmPlan& plan, std::size_t first, std::size_t rows,
                                  const float* packed_a, const ColumnPacker& columns,
                                  const ColumnPacker& next) {
  const std::size_t panels = columns.block().panels();
  const std::size_t fetches = rows * panels * DivideUp(columns.block().steps, kFetchSteps);
  LineFetcher fetcher = next.Fetcher(DivideUp(next.lines(), fetches));
  std::size_t packed = 0;
  for (std::size_t j = 0; j < panels; ++j) {
    for (std::size_t panel = first; panel < first + rows; ++panel) {
      MultiplyTile(plan, packed_a, panel, columns.block(), j,
                   FetchingColumns(columns.panel(j), fetcher));
      const std::size_t fetched = next.units() - fetcher.rows_left();
      if (fetched < packed + kPackedRows) continue;
      next.Pack(packed, fetched);
      packed = fetched;
    }
  }
  next.Pack(packed, next.units());
}

// Work item: one block of rows by one block of columns, the steps of depth blocks [depth, end).
// packed_b: plan.worker_size() floats.
inline void MultiplyItem(const GemmPlan& plan, std::size_t item, std::size_t depth, std::size_t end,
                         const float* packed_a, float* packed_b) {
  const std::size_t rows = item % plan.row_blocks.count(), columns = item / plan.row_blocks.count();
  const std::size_t panel = plan.row_blocks.begin(rows), panels = plan.row_blocks.size(rows);
  const std::size_t first = plan.column_blocks.begin(columns) * kTileColumns;
  const std::size_t last =
      std::min(plan.p.n, first + plan.column_blocks.size(columns) * kTileColumns);
  const auto packer = [&](std::size_t d) {
    return ColumnPacker(plan.p, {first, last, plan.depths.begin(d), plan.depths.size(d)},
                        packed_b + d % 2 * plan.packed_b_size());
  };
  const bool pack_ahead = !plan.p.transpose_b;
  for (std::size_t d = depth; d < end; ++d) {
    const ColumnPacker present = packer(d);
    const float* a = packed_a + plan.p.m * (plan.depths.begin(d) - plan.depths.begin(depth));
    if (d == depth || !pack_ahead) present.Pack(0, present.units());
    if (pack_ahead && d + 1 < end) {
      MultiplyAndPack(plan, panel, panels, a, present, packer(d + 1));
    } else {
      MultiplyBlock(plan, panel, panels, a, present);
    }
  }
}

void GemmTarget(const GemmProblem<float>& problem, const KernelContext& context) {
  const auto workers = static_cast<std::size_t>(context.workers.count());
  const GemmPlan plan(problem, GemmItems(problem.m, problem.n, workers));
  const std::size_t a_size = RoundUp(plan.packed_a_size(), kAlignment);
  float* packed_a = context.scratch.Floats(a_size + plan.worker_size() * workers);
  for (std::size_t pass = 0; pass < plan.passes.count(); ++pass) {
    const std::size_t depth = plan.passes.begin(pass), end = depth + plan.passes.size(pass);
    context.workers.For(plan.rows.count(), [&](std::size_t panel, std::size_t) {
      PackRowPanel(plan, panel, depth, end, packed_a);
    });
    context.workers.For(plan.row_blocks.count() * plan.column_blocks.count(),
                        [&](std::size_t item, std::size_t worker) {
                          MultiplyItem(plan, item, depth, end, packed_a,
                                       packed_a + a_size + worker * plan.worker_size());
                        });
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

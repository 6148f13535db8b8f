// SPDX-License-Identifier: Apache-2.0
// Matrix product, blocked after Goto and van de Geijn: Anatomy of high-performance matrix
// multiplication, ACM TOMS 34(3), 2008. A is packed once for all; every work item packs the slice
// of B that it needs and keeps a panel of it in L1 while panels of A stream past from L2. With few
// rows of A (a training batch) waiting for B would cost as much as multiplying: the next block of B
// is asked for between the tiles of the present one.

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
#include "nn/kernels/micro_kernel-inl.h"
#include "nn/kernels/pack-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

constexpr std::size_t kDepth = 256;        // steps of k in one pass: a B panel takes half of L1
constexpr std::size_t kItemRows = 256;     // kItemRows x kDepth of packed A take half of L2
constexpr std::size_t kItemColumns = 128;  // of C in one work item
constexpr std::size_t kPackedFloats = std::size_t{2} << 20;  // of A packed at a time, about

constexpr std::size_t kLineFloats = 16;  // in a cache line

struct GemmPlan {
  explicit GemmPlan(const GemmProblem<float>& problem)
      : p(problem),
        rows(p.m, kTileRows),
        row_blocks(rows.count(), kItemRows / kTileRows),
        column_blocks(DivideUp(p.n, kTileColumns), kItemColumns / kTileColumns),
        super_depth(std::max<std::size_t>(1, kPackedFloats / p.m / kDepth) * kDepth) {}

  std::size_t packed_a_size() const { return p.m * std::min(p.k, super_depth); }
  std::size_t packed_b_size() const { return kItemColumns * std::min(p.k, kDepth); }

  GemmProblem<float> p;
  Panels rows;           // panels of A
  Panels row_blocks;     // of those panels
  Panels column_blocks;  // of column panels
  std::size_t super_depth;
};

// Packs row panel `panel` of A for steps [k0, k1): depth blocks one after the other, each of all
// panels.
inline void PackRowPanel(const GemmPlan& plan, std::size_t panel, std::size_t k0, std::size_t k1,
                         float* packed) {
  const GemmProblem<float>& p = plan.p;
  const std::size_t row = plan.rows.begin(panel), rows = plan.rows.size(panel);
  for (std::size_t k = k0; k < k1; k += kDepth) {
    const std::size_t steps = std::min(kDepth, k1 - k);
    PackStrip({p.a, p.lda, p.transpose_a}, row, rows, k, steps,
              packed + p.m * (k - k0) + row * steps, rows);
  }
}

// One work item's columns and steps, packed: panels of kTileColumns, zeros behind column n.
struct ColumnBlock {
  std::size_t begin, end;  // columns of C
  std::size_t k, steps;
};

// Whole panels of a B that is not transposed, row by row: memory is read in long runs.
inline void PackWholePanels(const GemmProblem<float>& p, const ColumnBlock& block,
                            std::size_t panels, float* packed) {
  for (std::size_t k = 0; k < block.steps; ++k) {
    const float* row = p.b + (block.k + k) * p.ldb + block.begin;
    float* out = packed + k * kTileColumns;
    for (std::size_t panel = 0; panel < panels; ++panel) {
      CopyStrip(row + panel * kTileColumns, 0, kTileColumns, 1,
                out + panel * kTileColumns * block.steps, 0);
    }
  }
}

inline void PackColumns(const GemmProblem<float>& p, const ColumnBlock& block, float* packed) {
  std::size_t j = block.begin;
  if (!p.transpose_b) {
    const std::size_t whole = (block.end - block.begin) / kTileColumns;
    PackWholePanels(p, block, whole, packed);
    j += whole * kTileColumns;
  }
  for (; j < block.end; j += kTileColumns) {
    const std::size_t columns = std::min(kTileColumns, block.end - j);
    float* panel = packed + (j - block.begin) * block.steps;
    if (columns < kTileColumns) std::fill_n(panel, kTileColumns * block.steps, 0.0f);
    PackStrip({p.b, p.ldb, !p.transpose_b}, j, columns, block.k, block.steps, panel, kTileColumns);
  }
}

// Asks for share `part` of `parts` of the memory that PackColumns(block) will read.
inline void PrefetchColumns(const GemmProblem<float>& p, const ColumnBlock& block, std::size_t part,
                            std::size_t parts) {
  const std::size_t columns = block.end - block.begin;
  const std::size_t count = p.transpose_b ? columns : block.steps;
  const std::size_t length = p.transpose_b ? block.steps : columns;
  const float* data =
      p.transpose_b ? p.b + block.begin * p.ldb + block.k : p.b + block.k * p.ldb + block.begin;
  for (std::size_t i = count * part / parts; i < count * (part + 1) / parts; ++i) {
    for (std::size_t j = 0; j < length; j += kLineFloats) {
      __builtin_prefetch(data + i * p.ldb + j, 0, 2);  // read, into L2
    }
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

// The tiles of row panels [panel_begin, panel_end) and the columns of `block`. Meanwhile `next` is
// fetched.
inline void MultiplyBlock(const GemmPlan& plan, std::size_t panel_begin, std::size_t panel_end,
                          const ColumnBlock& block, const ColumnBlock& next, const float* packed_a,
                          const float* packed_b) {
  const std::size_t panels = panel_end - panel_begin;
  const std::size_t tiles = panels * DivideUp(block.end - block.begin, kTileColumns);
  std::size_t tile = 0;
  for (std::size_t j = block.begin; j < block.end; j += kTileColumns) {
    const PackedColumns columns{packed_b + (j - block.begin) * block.steps};
    for (std::size_t panel = panel_begin; panel < panel_end; ++panel, ++tile) {
      const std::size_t row = plan.rows.begin(panel);
      PrefetchColumns(plan.p, next, tile, tiles);
      PackedRowsTile(packed_a + row * block.steps, plan.rows.size(panel), columns, block.steps,
                     TargetOf(plan.p, row, j, block.k == 0));
    }
  }
}

// Work item: one block of rows by one block of columns, steps [k0, k1).
inline void MultiplyItem(const GemmPlan& plan, std::size_t item, std::size_t k0, std::size_t k1,
                         const float* packed_a, float* packed_b) {
  const std::size_t rows = item % plan.row_blocks.count(), columns = item / plan.row_blocks.count();
  const std::size_t panel = plan.row_blocks.begin(rows);
  const std::size_t begin = plan.column_blocks.begin(columns) * kTileColumns;
  const std::size_t end =
      std::min(plan.p.n, begin + plan.column_blocks.size(columns) * kTileColumns);
  for (std::size_t k = k0; k < k1; k += kDepth) {
    const ColumnBlock block{begin, end, k, std::min(kDepth, k1 - k)};
    const std::size_t next_k = std::min(k1, k + kDepth);
    const ColumnBlock next{begin, end, next_k, std::min(kDepth, k1 - next_k)};
    PackColumns(plan.p, block, packed_b);
    MultiplyBlock(plan, panel, panel + plan.row_blocks.size(rows), block, next,
                  packed_a + plan.p.m * (k - k0), packed_b);
  }
}

void GemmTarget(const GemmProblem<float>& problem, const KernelContext& context) {
  const GemmPlan plan(problem);
  const std::size_t a_size = RoundUp(plan.packed_a_size(), kAlignment);
  const std::size_t b_size = RoundUp(plan.packed_b_size(), kAlignment);
  float* packed_a =
      context.scratch.Floats(a_size + b_size * static_cast<std::size_t>(context.workers.count()));
  for (std::size_t k0 = 0; k0 < problem.k; k0 += plan.super_depth) {
    const std::size_t k1 = std::min(problem.k, k0 + plan.super_depth);
    context.workers.For(plan.rows.count(), [&](std::size_t panel, std::size_t) {
      PackRowPanel(plan, panel, k0, k1, packed_a);
    });
    context.workers.For(plan.row_blocks.count() * plan.column_blocks.count(),
                        [&](std::size_t item, std::size_t worker) {
                          MultiplyItem(plan, item, k0, k1, packed_a,
                                       packed_a + a_size + worker * b_size);
                        });
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

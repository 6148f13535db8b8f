// SPDX-License-Identifier: Apache-2.0
// Packs the large operand of a matrix product, a block of columns and steps at a time. With few
// rows on the other side (a training batch), copying it and its cache misses would cost as much as
// multiplying. So the tiles of the block before pack a B that is not transposed, a row of a panel
// every few steps. A transposed B is packed a whole block at a time, in runs as long as the block
// is deep, which the tiles of the block before prefetch.

#if defined(TILEGRAD_NN_KERNELS_GEMM_COLUMNS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_GEMM_COLUMNS_INL_H_
#undef TILEGRAD_NN_KERNELS_GEMM_COLUMNS_INL_H_
#else
#define TILEGRAD_NN_KERNELS_GEMM_COLUMNS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/gemm.h"
#include "nn/kernels/micro_kernel-inl.h"
#include "nn/kernels/pack-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// From one packed panel to the next. The line between them keeps the panels out of each other's
// cache sets while a row is written to all of them.
constexpr std::size_t PackedPanelStride(std::size_t steps) {
  return kTileColumns * steps + kLineFloats;
}

// Columns [begin, end) and steps [k, k + steps) of B, packed: panels of kTileColumns, zeros behind
// the last column.
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

  // Of a B that is not transposed: packs all but a last panel of fewer columns in `runs` runs.
  PanelCopier Copier(std::size_t runs) const {
    return PanelCopier(RowOf(0), p_.ldb, block_, packed_,
                       DivideUp(block_.steps * whole_panels(), runs));
  }
  // Of a transposed B: prefetches the block in `runs` runs.
  BlockFetcher Fetcher(std::size_t runs) const {
    const std::size_t columns = block_.end - block_.begin;
    return BlockFetcher(p_.b + block_.begin * p_.ldb + block_.k, p_.ldb, columns, block_.steps,
                        DivideUp(columns * DivideUp(block_.steps, kLineFloats), runs));
  }
  // The last panel of fewer columns.
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

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

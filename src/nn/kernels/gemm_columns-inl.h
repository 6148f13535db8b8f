// SPDX-License-Identifier: Apache-2.0
// The large operand of a matrix product, packed a block of columns and steps at a time. With few
// rows on the other side (a training batch) waiting for it would cost as much as multiplying: rows
// of a B that is not transposed are packed between the tiles of the block before them, when those
// tiles have fetched them into L1. (Fetching whole blocks into L2 fails: rows that lie a power of
// two apart share a few sets of that cache.) A transposed B is packed a block at a time, which
// reads it in runs as long as the block is deep.

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

// Packs one block in units, [0, units()), in any order: rows of B or, of a transposed B, panels.
class ColumnPacker {
 public:
  ColumnPacker(const GemmProblem<float>& problem, const ColumnBlock& block, float* packed)
      : p_(problem), block_(block), packed_(packed) {}

  const ColumnBlock& block() const { return block_; }
  const float* panel(std::size_t i) const { return packed_ + i * PackedPanelStride(block_.steps); }
  std::size_t units() const { return p_.transpose_b ? block_.panels() : block_.steps; }

  // Not inlined, or the sums of the caller's tiles would not stay in registers.
  HWY_NOINLINE void Pack(std::size_t begin, std::size_t end) const {
    for (std::size_t unit = begin; unit < end; ++unit) {
      p_.transpose_b ? PackPanel(unit) : PackRow(unit);
    }
  }

  // Fetches the block, `share` lines at a time; B not transposed.
  LineFetcher Fetcher(std::size_t share) const {
    return LineFetcher(RowOf(0), p_.ldb, block_.steps, block_.end - block_.begin, share);
  }
  std::size_t lines() const {
    return block_.steps * DivideUp(block_.end - block_.begin, kLineFloats);
  }

 private:
  const float* RowOf(std::size_t k) const { return p_.b + (block_.k + k) * p_.ldb + block_.begin; }

  // Row k of the block, read in one run and dealt out to all panels.
  void PackRow(std::size_t k) const {
    const std::size_t columns = block_.end - block_.begin, whole = columns / kTileColumns;
    const std::size_t stride = PackedPanelStride(block_.steps);
    const float* row = RowOf(k);
    float* out = packed_ + k * kTileColumns;
    for (std::size_t panel = 0; panel < whole; ++panel, row += kTileColumns, out += stride) {
      for (std::size_t v = 0; v < kTileColumns; v += kLanes) {
        hn::StoreU(hn::LoadU(Tag(), row + v), Tag(), out + v);
      }
    }
    const std::size_t rest = columns - whole * kTileColumns;
    if (rest > 0) std::fill(std::copy_n(row, rest, out), out + kTileColumns, 0.0f);
  }

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

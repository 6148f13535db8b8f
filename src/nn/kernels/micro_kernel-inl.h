// SPDX-License-Identifier: Apache-2.0
// The micro-kernel, the one inner loop of every matrix product and convolution: a tile of at most
// kTileRows x kTileColumns of C stays in registers while rank-one updates stream past. Policies
// supply the two factors: packed panels, rows of a matrix in place, or vectors addressed through a
// table of offsets (implicit convolution).

#if defined(TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#undef TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#else
#define TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "base/prefetch.h"
#include "nn/kernels/panels.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;
constexpr std::size_t kLanes = hn::MaxLanes(Tag());
constexpr std::size_t kTileVectors = 2;
constexpr std::size_t kMostTileVectors = 3;  // of a tile of few rows
constexpr std::size_t kTileColumns = kTileVectors * kLanes;
// Two FMA units of latency 4 need 8 independent sums at least; 6 x 2 sums, two vectors of B and one
// of A are 15 of 16 registers. With 32 registers, 12 x 2 halves the loads per FMA: AVX3 and better
// targets, which have lower bits and, in newer versions of Highway, other names.
#if (HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3) || HWY_TARGET == HWY_NEON
constexpr std::size_t kTileRows = 12;
constexpr std::size_t kRegisters = 32;  // of vectors
#else
constexpr std::size_t kTileRows = 6;
constexpr std::size_t kRegisters = 16;
#endif

// The row factor from a packed panel [k][R].
template <std::size_t R>
struct PackedRows {
  static constexpr std::size_t kRows = R;
  const float* next;
  HWY_INLINE Vec At(std::size_t row) const { return hn::Set(Tag(), next[row]); }
  HWY_INLINE void Advance() { next += R; }
};

// The row factor from R rows of a matrix in place (not packed): row r is at data[r], and one step
// of k is one float.
template <std::size_t R>
struct PlainRows {
  static constexpr std::size_t kRows = R;
  std::array<const float*, R> data;
  std::size_t k = 0;
  HWY_INLINE Vec At(std::size_t row) const { return hn::Set(Tag(), data[row][k]); }
  HWY_INLINE void Advance() { ++k; }
};

// The column factor from a packed panel [k][kTileColumns].
struct PackedColumns {
  static constexpr std::size_t kVectors = kTileVectors;
  const float* next;
  HWY_INLINE Vec At(std::size_t vector) const { return hn::LoadU(Tag(), next + vector * kLanes); }
  HWY_INLINE void Advance() { next += kTileColumns; }
};

// Steps of k between runs of a task: some 50 to 100 cycles. With 16 lanes the best of 2 to 8.
constexpr std::size_t kRunSteps = kLanes > 8 ? 4 : 8;

// A packed panel; `task` runs every kRunSteps steps, in issue slots for loads, stores and integer
// arithmetic that the FMAs leave free.
template <class Task>
struct BusyColumns : PackedColumns {
  BusyColumns(const float* panel, Task& t) : PackedColumns{panel}, task(t) {}
  Task& task;
};

// The column factor of step k at base[vector] + *offset.
template <std::size_t V>
struct IndirectColumns {
  static constexpr std::size_t kVectors = V;
  std::array<const float*, V> base;
  const std::size_t* offset;
  HWY_INLINE Vec At(std::size_t vector) const { return hn::LoadU(Tag(), base[vector] + *offset); }
  HWY_INLINE void Advance() { ++offset; }
};

// Destination of a tile: row r, vector v at c[r * ldc + offset[v]], with count[v] valid lanes.
struct TileTarget {
  float* c;
  std::size_t ldc;
  std::array<std::size_t, kMostTileVectors> offset;
  std::array<std::size_t, kMostTileVectors> count;
  const float* row_bias = nullptr;     // one float per row, or null
  const float* column_bias = nullptr;  // one float per column, at the same offsets as in c, or null
  bool accumulate = false;
};

HWY_INLINE Vec WithBiasAndOld(Vec sum, const TileTarget& t, std::size_t row, const float* bias,
                              const float* c) {
  if (t.row_bias != nullptr) sum = hn::Add(sum, hn::Set(Tag(), t.row_bias[row]));
  if (t.column_bias != nullptr) sum = hn::Add(sum, hn::LoadU(Tag(), bias));
  return t.accumulate ? hn::Add(hn::LoadU(Tag(), c), sum) : sum;
}

// Through a copy, without touching memory beyond the valid lanes.
inline HWY_NOINLINE void StorePartialVector(Vec sum, const TileTarget& t, std::size_t row,
                                            std::size_t v) {
  HWY_ALIGN float bias[kLanes] = {}, c[kLanes] = {};
  float* out = t.c + row * t.ldc + t.offset[v];
  for (std::size_t i = 0; i < t.count[v]; ++i) {
    if (t.column_bias != nullptr) bias[i] = t.column_bias[t.offset[v] + i];
    if (t.accumulate) c[i] = out[i];
  }
  hn::Store(WithBiasAndOld(sum, t, row, bias, c), Tag(), c);
  for (std::size_t i = 0; i < t.count[v]; ++i) out[i] = c[i];
}

HWY_INLINE void StoreVector(Vec sum, const TileTarget& t, std::size_t row, std::size_t v) {
  if (HWY_UNLIKELY(t.count[v] != kLanes)) return StorePartialVector(sum, t, row, v);
  float* c = t.c + row * t.ldc + t.offset[v];
  const float* bias = t.column_bias == nullptr ? nullptr : t.column_bias + t.offset[v];
  hn::StoreU(WithBiasAndOld(sum, t, row, bias, c), Tag(), c);
}

// The sums of a tile of R rows and V vectors. Loops over both are fold expressions over
// always-inlined members: arrays of vectors stay in registers only if every index is a constant
// before the optimiser looks.
template <std::size_t R, std::size_t V = kTileVectors, class Row = std::make_index_sequence<R>,
          class Vector = std::make_index_sequence<V>>
struct Tile;

template <std::size_t R, std::size_t V, std::size_t... row, std::size_t... vector>
struct Tile<R, V, std::index_sequence<row...>, std::index_sequence<vector...>> {
  Vec sum[R][V];

  HWY_INLINE void Clear() { (ClearRow<row>(), ...); }
  // sum += rows columns^T over `steps` steps of k. The compiler unrolls a run completely, with an
  // exit after each step. (As a separate function it made products 2 to 3 % slower.)
  template <class Rows, class Columns>
  HWY_INLINE void Multiply(Rows& rows, Columns& columns, std::size_t steps) {
    constexpr bool kBusy = requires { columns.task; };
    if constexpr (kSparesRegister && !kBusy) {
      for (; steps >= 2; steps -= 2) {
        MultiplyStep(rows, columns);
        MultiplyStep(rows, columns);
      }
      if (steps > 0) MultiplyStep(rows, columns);
    } else {
      while (steps > 0) {
        if constexpr (kBusy) columns.task.Run();
        const std::size_t now = std::min(steps, kRunSteps);
        for (std::size_t k = 0; k < now; ++k) MultiplyStep(rows, columns);
        steps -= now;
      }
    }
  }
  template <class Rows, class Columns>
  HWY_INLINE void MultiplyStep(Rows& rows, Columns& columns) {
    const Vec b[V] = {columns.At(vector)...};
    (AddProduct<row>(rows.At(row), b), ...);
    rows.Advance();
    columns.Advance();
  }
  HWY_INLINE void Store(const TileTarget& t) const {
    const bool plain =
        t.row_bias == nullptr && t.column_bias == nullptr && (t.count[vector] + ...) == V * kLanes;
    plain ? StoreWhole(t) : StoreAny(t);
  }

 private:
  // If a register is left beside the sums, V vectors of columns and one of a row, joins two steps,
  // so that the second one's loads may be scheduled earlier. Otherwise sums would spill, and the
  // exits of a run keep steps apart. docs/lab.md has the effect of either.
  static constexpr bool kSparesRegister = R * V + V + 1 < kRegisters;

  template <std::size_t r>
  HWY_INLINE void ClearRow() {
    ((sum[r][vector] = hn::Zero(Tag())), ...);
  }
  template <std::size_t r>
  HWY_INLINE void AddProduct(Vec a, const Vec (&b)[V]) {
    ((sum[r][vector] = hn::MulAdd(a, b[vector], sum[r][vector])), ...);
  }
  // The common case, without a test per vector.
  HWY_INLINE void StoreWhole(const TileTarget& t) const {
    float* const c[V] = {t.c + t.offset[vector]...};
    t.accumulate ? (AddRow<row>(c, row * t.ldc), ...) : (StoreRow<row>(c, row * t.ldc), ...);
  }
  template <std::size_t r>
  HWY_INLINE void AddRow(float* const (&c)[V], std::size_t at) const {
    (hn::StoreU(hn::Add(hn::LoadU(Tag(), c[vector] + at), sum[r][vector]), Tag(), c[vector] + at),
     ...);
  }
  template <std::size_t r>
  HWY_INLINE void StoreRow(float* const (&c)[V], std::size_t at) const {
    (hn::StoreU(sum[r][vector], Tag(), c[vector] + at), ...);
  }
  HWY_INLINE void StoreAny(const TileTarget& t) const { (StoreAnyRow<row>(t), ...); }
  template <std::size_t r>
  HWY_INLINE void StoreAnyRow(const TileTarget& t) const {
    (StoreVector(sum[r][vector], t, r, vector), ...);
  }
};

// Prefetches the lines that Store will write. Into L2: rows of C may be a power of two apart, so
// that L1 can hold only a few of them.
template <std::size_t R, std::size_t V>
HWY_INLINE void FetchTarget(const TileTarget& t) {
  constexpr std::size_t kVectorsOfLine = std::max<std::size_t>(1, kLineFloats / kLanes);
  for (std::size_t v = 0; v < V; v += kVectorsOfLine) {
    for (std::size_t r = 0; r < R; ++r) PrefetchLineToL2(t.c + r * t.ldc + t.offset[v]);
  }
}

template <class Rows, class Columns>
HWY_INLINE void RunTile(Rows rows, Columns columns, std::size_t steps, const TileTarget& target) {
  Tile<Rows::kRows, Columns::kVectors> tile;
  tile.Clear();
  FetchTarget<Rows::kRows, Columns::kVectors>(target);
  tile.Multiply(rows, columns, steps);
  tile.Store(target);
}

// One tile from packed rows [k][rows], rows in [1, R], and any column factor.
template <class Columns, std::size_t R = kTileRows>
HWY_INLINE void PackedRowsTile(const float* packed, std::size_t rows, Columns columns,
                               std::size_t steps, const TileTarget& target) {
  if (rows == R) {
    RunTile(PackedRows<R>{packed}, columns, steps, target);
  } else if constexpr (R > 1) {
    PackedRowsTile<Columns, R - 1>(packed, rows, columns, steps, target);
  }
}

// Packs a strip of a matrix in the order in which the micro-kernel reads it.

// Four numbers of one row, or of rows i and i + 4, concatenated.
template <class D>
HWY_INLINE hn::Vec<D> LoadFours(D d, const float* in, std::size_t in_stride) {
  if constexpr (hn::MaxLanes(d) == 4) {
    return hn::LoadU(d, in);
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, hn::LoadU(half, in + 4 * in_stride), hn::LoadU(half, in));
  }
}

// out[k * out_stride + i] = in[i * in_stride + k] for k < 4 and as many i as d has lanes, 4 or 8.
template <class D>
HWY_INLINE void TransposeFours(D d, const float* in, std::size_t in_stride, float* out,
                               std::size_t out_stride) {
  const hn::RepartitionToWide<D> pairs;
  const auto r0 = LoadFours(d, in, in_stride), r1 = LoadFours(d, in + in_stride, in_stride);
  const auto r2 = LoadFours(d, in + 2 * in_stride, in_stride);
  const auto r3 = LoadFours(d, in + 3 * in_stride, in_stride);
  const auto low01 = hn::BitCast(pairs, hn::InterleaveLower(d, r0, r1));  // r0[0] r1[0] r0[1] r1[1]
  const auto low23 = hn::BitCast(pairs, hn::InterleaveLower(d, r2, r3));
  const auto high01 = hn::BitCast(pairs, hn::InterleaveUpper(d, r0, r1));
  const auto high23 = hn::BitCast(pairs, hn::InterleaveUpper(d, r2, r3));
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, low01, low23)), d, out);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, low01, low23)), d, out + out_stride);
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, high01, high23)), d, out + 2 * out_stride);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, high01, high23)), d, out + 3 * out_stride);
}

// The same for i < rows and k < steps, `d` lanes at a time; needs rows >= Lanes(d) and whole fours
// of steps.
template <class D>
HWY_INLINE void TransposeStripBy(D d, const float* in, std::size_t in_stride, std::size_t rows,
                                 std::size_t steps, float* out, std::size_t out_stride) {
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i < rows; i += lanes) {
    const std::size_t row = std::min(i, rows - lanes);  // may overlap the previous block
    for (std::size_t k = 0; k < steps; k += 4) {
      TransposeFours(d, in + row * in_stride + k, in_stride, out + k * out_stride + row,
                     out_stride);
    }
  }
}

// out[k * out_stride + i] = in[i * in_stride + k] for i < rows, k < steps. Writes nothing else.
inline void TransposeStrip(const float* in, std::size_t in_stride, std::size_t rows,
                           std::size_t steps, float* out, std::size_t out_stride) {
  const hn::CappedTag<float, 8> wide;
  const std::size_t whole = rows < 4 ? 0 : steps / 4 * 4;
  if (rows >= hn::Lanes(wide)) {
    TransposeStripBy(wide, in, in_stride, rows, whole, out, out_stride);
  } else if (rows >= 4) {
    TransposeStripBy(hn::FixedTag<float, 4>(), in, in_stride, rows, whole, out, out_stride);
  }
  for (std::size_t k = whole; k < steps; ++k) {
    for (std::size_t i = 0; i < rows; ++i) out[k * out_stride + i] = in[i * in_stride + k];
  }
}

// out[k * out_stride + i] = in[k * in_stride + i] for i < rows, k < steps, `d` lanes at a time;
// needs rows >= Lanes(d).
template <class D>
HWY_INLINE void CopyStripBy(D d, const float* in, std::size_t in_stride, std::size_t rows,
                            std::size_t steps, float* out, std::size_t out_stride) {
  const std::size_t lanes = hn::Lanes(d), last = rows - lanes;
  for (std::size_t k = 0; k < steps; ++k, in += in_stride, out += out_stride) {
    for (std::size_t i = 0; i < last; i += lanes) hn::StoreU(hn::LoadU(d, in + i), d, out + i);
    hn::StoreU(hn::LoadU(d, in + last), d, out + last);  // may overlap the previous one
  }
}

inline void CopyStrip(const float* in, std::size_t in_stride, std::size_t rows, std::size_t steps,
                      float* out, std::size_t out_stride) {
  if (rows >= kLanes) {
    CopyStripBy(Tag(), in, in_stride, rows, steps, out, out_stride);
  } else if (rows >= 4) {
    CopyStripBy(hn::FixedTag<float, 4>(), in, in_stride, rows, steps, out, out_stride);
  } else {
    CopyStripBy(hn::FixedTag<float, 1>(), in, in_stride, rows, steps, out, out_stride);
  }
}

// A matrix op(M) for the packers: if `transposed`, rows are contiguous, not steps.
struct PackSource {
  const float* data;
  std::size_t ld;
  bool rows_contiguous;
};

// out[k * out_stride + i] = element (row + i, step + k) of the source.
inline void PackStrip(const PackSource& s, std::size_t row, std::size_t rows, std::size_t step,
                      std::size_t steps, float* out, std::size_t out_stride) {
  if (s.rows_contiguous) {
    CopyStrip(s.data + step * s.ld + row, s.ld, rows, steps, out, out_stride);
  } else {
    TransposeStrip(s.data + row * s.ld + step, s.ld, rows, steps, out, out_stride);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

// SPDX-License-Identifier: Apache-2.0
// The one inner loop of every matrix product and convolution: a tile of at most kTileRows x
// kTileColumns of C stays in registers while rank-one updates stream past. Where the two factors
// come from is a policy: packed panels, rows of a matrix as they lie, or vectors addressed through
// a table of offsets (implicit convolution).

#if defined(TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#undef TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#else
#define TILEGRAD_NN_KERNELS_MICRO_KERNEL_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "nn/kernels/panels.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;
constexpr std::size_t kLanes = hn::MaxLanes(Tag());
constexpr std::size_t kTileVectors = 2;
constexpr std::size_t kTileColumns = kTileVectors * kLanes;
// Two FMA units of latency 4 need 8 independent sums at least; 6 x 2 sums, two vectors of B and one
// of A are 15 of 16 registers. Where there are 32 registers, 12 x 2 halve the loads per FMA.
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_ZEN4 || HWY_TARGET == HWY_NEON
constexpr std::size_t kTileRows = 12;
#else
constexpr std::size_t kTileRows = 6;
#endif

// The row factor from a packed panel [k][R].
template <std::size_t R>
struct PackedRows {
  const float* next;
  HWY_INLINE Vec At(std::size_t row) const { return hn::Set(Tag(), next[row]); }
  HWY_INLINE void Advance() { next += R; }
};

// The row factor from R rows as they lie in memory, row r at data[r], one step of k being one
// float.
template <std::size_t R>
struct PlainRows {
  std::array<const float*, R> data;
  std::size_t k = 0;
  HWY_INLINE Vec At(std::size_t row) const { return hn::Set(Tag(), data[row][k]); }
  HWY_INLINE void Advance() { ++k; }
};

// The column factor from a packed panel [k][kTileColumns].
struct PackedColumns {
  const float* next;
  HWY_INLINE Vec At(std::size_t vector) const { return hn::LoadU(Tag(), next + vector * kLanes); }
  HWY_INLINE void Advance() { next += kTileColumns; }
};

// The column factor of step k at base[vector] + *offset.
struct IndirectColumns {
  std::array<const float*, kTileVectors> base;
  const std::ptrdiff_t* offset;
  HWY_INLINE Vec At(std::size_t vector) const { return hn::LoadU(Tag(), base[vector] + *offset); }
  HWY_INLINE void Advance() { ++offset; }
};

template <std::size_t... I, class F>
HWY_INLINE void UnrollOver(std::index_sequence<I...>, const F& f) {
  (f(std::integral_constant<std::size_t, I>()), ...);
}

// The sums of a tile of R rows. Loops over rows are unrolled by hand: arrays of vectors stay in
// registers only if every index is a constant before the optimiser looks.
template <std::size_t R>
struct Tile {
  Vec sum[R][kTileVectors];

  template <class F>
  static HWY_INLINE void ForEachRow(const F& f) {
    UnrollOver(std::make_index_sequence<R>(), f);
  }
  HWY_INLINE void Clear() {
    ForEachRow([&](auto r) HWY_ATTR { sum[r][0] = sum[r][1] = hn::Zero(Tag()); });
  }
  // sum += rows columns^T over `steps` steps of k; both factors move on.
  template <class Rows, class Columns>
  HWY_INLINE void Multiply(Rows& rows, Columns& columns, std::size_t steps) {
    for (std::size_t k = 0; k < steps; ++k) {
      const Vec b0 = columns.At(0), b1 = columns.At(1);
      ForEachRow([&](auto r) HWY_ATTR {
        const Vec a = rows.At(r);
        sum[r][0] = hn::MulAdd(a, b0, sum[r][0]);
        sum[r][1] = hn::MulAdd(a, b1, sum[r][1]);
      });
      rows.Advance();
      columns.Advance();
    }
  }
};

// Where a tile goes: row r, vector v to c[r * ldc + offset[v]], of which count[v] lanes exist.
struct TileTarget {
  float* c;
  std::size_t ldc;
  std::array<std::size_t, kTileVectors> offset;
  std::array<std::size_t, kTileVectors> count;
  const float* row_bias = nullptr;     // one float a row, or none
  const float* column_bias = nullptr;  // one float a column, at the same offsets as in c, or none
  bool accumulate = false;
};

// The `count` first lanes of p, the others 0, without touching memory behind them.
HWY_INLINE Vec LoadFirst(const float* p, std::size_t count) {
  if (count == kLanes) return hn::LoadU(Tag(), p);
  HWY_ALIGN float lanes[kLanes] = {};
  for (std::size_t i = 0; i < count; ++i) lanes[i] = p[i];
  return hn::Load(Tag(), lanes);
}

HWY_INLINE void StoreFirst(Vec v, float* p, std::size_t count) {
  if (count == kLanes) return hn::StoreU(v, Tag(), p);
  HWY_ALIGN float lanes[kLanes];
  hn::Store(v, Tag(), lanes);
  for (std::size_t i = 0; i < count; ++i) p[i] = lanes[i];
}

HWY_INLINE void StoreVector(Vec sum, const TileTarget& t, std::size_t row, std::size_t v) {
  float* c = t.c + row * t.ldc + t.offset[v];
  if (t.row_bias != nullptr) sum = hn::Add(sum, hn::Set(Tag(), t.row_bias[row]));
  if (t.column_bias != nullptr) {
    sum = hn::Add(sum, LoadFirst(t.column_bias + t.offset[v], t.count[v]));
  }
  if (t.accumulate) sum = hn::Add(LoadFirst(c, t.count[v]), sum);
  StoreFirst(sum, c, t.count[v]);
}

template <std::size_t R>
HWY_INLINE void StoreTile(const Tile<R>& tile, const TileTarget& target) {
  Tile<R>::ForEachRow([&](auto r) HWY_ATTR {
    StoreVector(tile.sum[r][0], target, r, 0);
    StoreVector(tile.sum[r][1], target, r, 1);
  });
}

// f(integral_constant<rows>) for a run-time count of rows in [1, kTileRows].
template <std::size_t R = kTileRows, class F>
HWY_INLINE void WithRows(std::size_t rows, const F& f) {
  if (rows == R) {
    f(std::integral_constant<std::size_t, R>());
  } else if constexpr (R > 1) {
    WithRows<R - 1>(rows, f);
  }
}

// One tile from packed rows [k][rows] and any column factor.
template <class Columns>
HWY_NOINLINE void PackedRowsTile(const float* packed, std::size_t rows, Columns columns,
                                 std::size_t steps, const TileTarget& target) {
  WithRows(rows, [&](auto r) HWY_ATTR {
    Tile<r> tile;
    PackedRows<r> factor{packed};
    tile.Clear();
    tile.Multiply(factor, columns, steps);
    StoreTile(tile, target);
  });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

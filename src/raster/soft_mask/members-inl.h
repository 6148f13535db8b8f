// SPDX-License-Identifier: Apache-2.0
// The members of a block's lists, one vector at a time, and the pixels that see them. Lanes are
// faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_MEMBERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_MEMBERS_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_MEMBERS_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_MEMBERS_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>

#include "base/simd_math-inl.h"
#include "raster/soft_mask/block-inl.h"
#include "raster/soft_mask/features-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace simd = tilegrad::HWY_NAMESPACE;

// Calls visit(pixel) for each bit.
template <class Visit>
HWY_INLINE void ForPixels(std::uint64_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::size_t>(std::countr_zero(bits)));
}

// Calls visit(row, bits of its columns) for each row that has any.
template <class Visit>
HWY_INLINE void ForRowsOf(std::uint64_t bits, const Visit& visit) {
  for (std::uint32_t rows = RowsOf(bits); rows != 0; rows &= rows - 1) {
    const auto row = static_cast<std::size_t>(std::countr_zero(rows));
    visit(row, bits >> row * kBlockSize & 0xff);
  }
}

// The pixels of `among` that see one of the members of a list from m on.
HWY_INLINE std::uint64_t PixelsOf(SoftTag d, const SoftLists& lists, const SoftList& list,
                                  std::size_t m, std::uint64_t among) {
  std::uint64_t bits = 0;
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) bits |= lists.pixels[list.slot[m + lane]];
  return bits & among;
}

// Counts the pairs of members from m on and `pixels`, and the powers: one per pair.
HWY_INLINE void NotePairs(SoftTag d, std::uint64_t pixels, SoftWork* work) {
  const auto pairs = static_cast<std::int64_t>(hn::Lanes(d)) * std::popcount(pixels);
  work->pairs += pairs;
  work->powers += pairs;
}
// The same for corners: one power per column and row.
HWY_INLINE void NoteVertexPairs(SoftTag d, std::uint64_t pixels, SoftWork* work) {
  const auto lanes = static_cast<std::int64_t>(hn::Lanes(d));
  work->pairs += lanes * std::popcount(pixels);
  work->powers += lanes * (std::popcount(ColumnsOf(pixels)) + std::popcount(RowsOf(pixels)));
}

// 2^-(squared offset) along one axis, [column or row]; where kWithOffsets, also the offsets and the
// largest power.
template <bool kWithOffsets>
struct AxisInfluence {
  SoftVec power[kBlockSize], offsets[kWithOffsets ? kBlockSize : 1], most;

  // For the bits of `pixels`, columns or rows at `at`.
  HWY_INLINE AxisInfluence(SoftTag d, const float* at, SoftVec vertex, std::uint32_t pixels) {
    SoftVec largest = hn::Zero(d);  // a local, to stay in a register
    for (; pixels != 0; pixels &= pixels - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(pixels));
      const SoftVec offset = hn::Sub(hn::Set(d, at[i]), vertex);
      power[i] = simd::Exp2Neg(d, hn::Mul(offset, offset)).power;
      if constexpr (kWithOffsets) {
        offsets[i] = offset;
        largest = hn::Max(largest, power[i]);
      }
    }
    most = largest;
  }
};

// A vector of corners. Equation 5 factors: A = 2^-(x - vx)^2 2^-(y - vy)^2, one power per column
// and per row.
template <bool kWithOffsets>
struct VertexMembers {
  AxisInfluence<kWithOffsets> columns, rows;

  HWY_INLINE VertexMembers(SoftTag d, const SoftListOf<2>& list, std::size_t m,
                           const SoftBlock& block, std::uint64_t bits)
      : columns(d, block.x, hn::Load(d, list.v[0] + m), ColumnsOf(bits)),
        rows(d, block.y, hn::Load(d, list.v[1] + m), RowsOf(bits)) {}
  HWY_INLINE SoftVec Influence(std::size_t pixel) const {
    return hn::Mul(columns.power[pixel % kBlockSize], rows.power[pixel / kBlockSize]);  // (5)
  }
  // All within `limit`.
  HWY_INLINE bool AllWithin(SoftTag d, float limit) const requires kWithOffsets {
    return hn::AllTrue(d, hn::Le(hn::Mul(columns.most, rows.most), hn::Set(d, limit)));
  }
};

// The offset of a pixel from edges: (side, beyond) leads from the nearest point to the pixel in the
// edge's frame (n, t); `along` is that point's distance from the first corner.
struct EdgeOffset {
  SoftVec side, beyond, along;
};
HWY_INLINE SoftVec SquaredLength(const EdgeOffset& o) {
  return hn::MulAdd(o.beyond, o.beyond, hn::Mul(o.side, o.side));
}

// A vector of edges.
struct EdgeMembers {
  SoftVec tx, ty, side, first, last, inverse;

  // From arrays `stride` apart.
  HWY_INLINE EdgeMembers(SoftTag d, const float* v, std::size_t stride)
      : tx(hn::Load(d, v + SoftLists::kTx * stride)),
        ty(hn::Load(d, v + SoftLists::kTy * stride)),
        side(hn::Load(d, v + SoftLists::kSide * stride)),
        first(hn::Load(d, v + SoftLists::kFirst * stride)),
        last(hn::Load(d, v + SoftLists::kLast * stride)),
        inverse(hn::Load(d, v + SoftLists::kInverse * stride)) {}
  HWY_INLINE EdgeOffset At(SoftTag d, const SoftBlock& block, std::size_t pixel) const {
    const SoftVec x = hn::Set(d, block.x[pixel % kBlockSize]);
    const SoftVec y = hn::Set(d, block.y[pixel / kBlockSize]);
    EdgeOffset o;
    o.side = hn::MulAdd(tx, y, hn::NegMulAdd(ty, x, side));
    const SoftVec step = hn::MulAdd(tx, x, hn::Mul(ty, y));
    // Never before the first corner, even if rounding puts the last one there.
    const SoftVec nearest = hn::Max(hn::Min(step, last), first);
    o.beyond = hn::Sub(step, nearest);
    o.along = hn::Sub(nearest, first);
    return o;
  }
};

// A vector of boundaries: three edges each.
struct BoundaryMembers {
  EdgeMembers edge[3];

  HWY_INLINE BoundaryMembers(SoftTag d, const float* v, std::size_t stride)
      : edge{{d, v, stride},
             {d, v + SoftLists::kEdgeArrays * stride, stride},
             {d, v + 2 * SoftLists::kEdgeArrays * stride, stride}} {}
  HWY_INLINE SoftVec Z(SoftTag d, const SoftBlock& block, std::size_t pixel) const {
    const auto z = [&](std::size_t k)
                       HWY_ATTR { return SquaredLength(edge[k].At(d, block, pixel)); };
    return hn::Min(hn::Min(z(0), z(1)), z(2));
  }
};

// v of the other half of each pair, quartet, octet of lanes.
HWY_INLINE SoftVec Neighbour(SoftTag, SoftVec v) { return hn::Shuffle2301(v); }
HWY_INLINE SoftVec NextPair(SoftTag, SoftVec v) { return hn::Shuffle1032(v); }
HWY_INLINE SoftVec NextQuartet(SoftTag d, SoftVec v) { return hn::ReverseBlocks(d, v); }

// The products of all lanes, and of all lanes but one's own.
struct LaneProducts {
  SoftVec all, others;

  HWY_INLINE LaneProducts(SoftTag d, SoftVec v) {
    others = Neighbour(d, v);
    all = hn::Mul(v, others);
    const SoftVec pairs = NextPair(d, all);
    others = hn::Mul(others, pairs);
    all = hn::Mul(all, pairs);
    if constexpr (hn::MaxLanes(d) > 4) {
      const SoftVec quartets = NextQuartet(d, all);
      others = hn::Mul(others, quartets);
      all = hn::Mul(all, quartets);
    }
  }
};

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// Which features of a face the pixels of a block see: one corner, the inside of one edge, one edge,
// or anything ("Nearest features"). Lanes are faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <initializer_list>

#include "base/simd_math-inl.h"
#include "raster/soft_mask_faces-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// Squared distance of the block's centre to the boundaries.
HWY_INLINE SoftVec CentreZ(SoftTag d, const FaceEdges& f) {
  SoftVec z[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto beyond = hn::Add(hn::Max(f.past[k], hn::Zero(d)), hn::Min(f.along[k], hn::Zero(d)));
    z[k] = hn::MulAdd(f.side[k], f.side[k], hn::Mul(beyond, beyond));
  }
  return hn::Min(hn::Min(z[0], z[1]), z[2]);
}

// The face's box is within `reach` of that of the block's background.
template <class Corners>
HWY_INLINE SoftMask IsBoxNear(SoftTag d, const Corners& f, const SoftBlock& block, float reach) {
  const auto gap = [&](const SoftVec(&at)[3], float half) HWY_ATTR {
    const auto low = hn::Min(hn::Min(at[0], at[1]), at[2]);
    const auto high = hn::Max(hn::Max(at[0], at[1]), at[2]);
    const SoftVec h = hn::Set(d, half);
    return hn::Max(hn::Sub(hn::Max(low, hn::Neg(high)), h), hn::Zero(d));
  };
  const auto x = gap(f.x, block.half_x), y = gap(f.y, block.half_y);
  return hn::Le(hn::MulAdd(x, x, hn::Mul(y, y)), hn::Set(d, reach * reach));
}

// The pixels of a block along one axis: the first, and how many kernel units are between them.
struct PixelAxis {
  float first, unit;
};

// Pixels along one axis within reach of the faces' boxes: the first, and 256 times the one behind
// the last.
HWY_INLINE SoftInt PixelsNear(SoftTag d, const SoftVec (&corner)[3], const PixelAxis& axis,
                              float reach) {
  const SoftIntTag di;
  const auto low = hn::Min(hn::Min(corner[0], corner[1]), corner[2]);
  const auto high = hn::Max(hn::Max(corner[0], corner[1]), corner[2]);
  const SoftVec per_unit = hn::Set(d, 1 / axis.unit);
  const auto pixel = [&](SoftVec at, float shift) HWY_ATTR {
    return hn::Mul(hn::Add(at, hn::Set(d, shift - axis.first)), per_unit);
  };
  // 1/64 covers rounding, which is relative to pixel numbers up to a few hundred.
  const auto begin = hn::Ceil(hn::Sub(pixel(low, -reach), hn::Set(d, 1.0f / 64)));
  const auto end = hn::Floor(hn::Add(pixel(high, reach), hn::Set(d, 1 + 1.0f / 64)));
  const auto clamp = [&](SoftVec v) HWY_ATTR {
    return hn::ConvertTo(di, hn::Min(hn::Max(v, hn::Zero(d)), hn::Set(d, float{kBlockSize})));
  };
  return hn::Add(clamp(begin), hn::ShiftLeft<8>(clamp(end)));
}

// Bits of the pixels of a SoftList::range.
HWY_INLINE std::uint64_t RangeBits(std::int32_t range) {
  const auto byte = [&](int i) { return static_cast<std::uint32_t>(range) >> 8 * i & 0xff; };
  const BitsFrom &rows = kBitsFrom.rows, &columns = kBitsFrom.columns;
  return rows.bits[byte(0)] & ~rows.bits[byte(1)] & columns.bits[byte(2)] & ~columns.bits[byte(3)];
}

// One of three by lanes.
template <class V, class M>
HWY_INLINE V Pick(const V (&v)[3], M first, M second) {
  return hn::IfThenElse(first, v[0], hn::IfThenElse(second, v[1], v[2]));
}

// What is appended with each member.
struct MemberTags {
  SoftInt slot, range;
};

HWY_INLINE void AppendTags(const MemberTags& tags, SoftInt part, const Compactor& compact,
                           SoftList* to) {
  compact.Store(tags.slot, to->slot + to->count), compact.Store(part, to->part + to->count);
  compact.Store(tags.range, to->range + to->count);
  to->count += compact.count();
}

// 0, 1 or 2 by lanes.
HWY_INLINE SoftInt PartOf(SoftMask first, SoftMask second) {
  const SoftIntTag di;
  const SoftInt parts[3] = {hn::Zero(di), hn::Set(di, 1), hn::Set(di, 2)};
  return Pick(parts, hn::RebindMask(di, first), hn::RebindMask(di, second));
}

HWY_INLINE void AppendEdges(SoftTag d, const FaceEdges& f, const MemberTags& tags, SoftMask keep,
                            const SoftMask (&only)[3], SoftListOf<SoftLists::kEdgeArrays>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  const auto append = [&](SoftLists::Edge a, const SoftVec(&v)[3]) HWY_ATTR {
    compact.Store(Pick(v, only[0], only[1]), to->v[a] + to->count);
  };
  append(SoftLists::kTx, f.tx), append(SoftLists::kTy, f.ty), append(SoftLists::kSide, f.side);
  append(SoftLists::kAlong, f.along), append(SoftLists::kPast, f.past);
  append(SoftLists::kInverse, f.inverse);
  AppendTags(tags, PartOf(only[0], only[1]), compact, to);
}

HWY_INLINE void AppendVertices(SoftTag d, const FaceEdges& f, const MemberTags& tags, SoftMask keep,
                               const SoftMask (&only)[3], SoftListOf<2>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  compact.Store(Pick(f.x, only[0], only[1]), to->v[0] + to->count);
  compact.Store(Pick(f.y, only[0], only[1]), to->v[1] + to->count);
  AppendTags(tags, PartOf(only[0], only[1]), compact, to);
}

HWY_INLINE void AppendBoundaries(SoftTag d, const FaceEdges& f, const MemberTags& tags,
                                 SoftMask keep, SoftListOf<3 * SoftLists::kEdgeArrays>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftVec edge[] = {f.tx[k], f.ty[k], f.side[k], f.along[k], f.past[k], f.inverse[k]};
    for (std::size_t a = 0; a < SoftLists::kEdgeArrays; ++a) {
      compact.Store(edge[a], to->v[k * SoftLists::kEdgeArrays + a] + to->count);
    }
  }
  AppendTags(tags, hn::Zero(SoftIntTag()), compact, to);
}

// Appends those of `valid` that are not far. Faces nearer than `reach.near` go to the boundaries if
// `split`, whatever is seen of them.
HWY_INLINE void AppendFeatures(SoftTag d, const FaceEdges& f, SoftMask valid, SoftInt slot,
                               const SoftBlock& block, const SoftReach& reach, const SoftBox& unit,
                               bool split, SoftLists* lists) {
  const float r = reach.root + block.radius;
  const SoftMask keep = hn::And(valid, hn::Le(CentreZ(d, f), hn::Set(d, r * r)));
  if (hn::AllFalse(d, keep)) return;
  SoftMask start[3], end[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftVec zero = hn::Zero(d);
    const SoftVec half = hn::MulAdd(hn::Abs(f.tx[k]), hn::Set(d, block.half_x),
                                    hn::Mul(hn::Abs(f.ty[k]), hn::Set(d, block.half_y)));
    start[k] = hn::Le(hn::Add(f.along[k], half), zero);
    end[k] = hn::Ge(hn::Sub(f.past[k], half), zero);
  }
  SoftMask far = keep;
  if (split) far = hn::AndNot(IsBoxNear(d, f, block, reach.near), keep);
  const SoftMask corner[3] = {hn::And(start[0], end[2]), hn::And(start[1], end[0]),
                              hn::And(start[2], end[1])};
  const SoftMask edge[3] = {hn::And(start[1], end[2]), hn::And(start[2], end[0]),
                            hn::And(start[0], end[1])};
  const SoftMask vertex = hn::And(far, hn::Or(hn::Or(corner[0], corner[1]), corner[2]));
  const SoftMask segment =
      hn::AndNot(vertex, hn::And(far, hn::Or(hn::Or(edge[0], edge[1]), edge[2])));
  const SoftInt rows = PixelsNear(d, f.y, {block.y[0], unit.unit_y}, reach.root);
  const SoftInt columns = PixelsNear(d, f.x, {block.x[0], unit.unit_x}, reach.root);
  const MemberTags tags{slot, hn::Add(rows, hn::ShiftLeft<16>(columns))};
  AppendVertices(d, f, tags, vertex, corner, &lists->vertices);
  AppendEdges(d, f, tags, segment, edge, &lists->segments);
  AppendBoundaries(d, f, tags, hn::AndNot(hn::Or(vertex, segment), keep), &lists->boundaries);
}

// Fills a list up to whole vectors: `far` are its arrays of distances.
template <std::size_t kArrays>
HWY_INLINE void PadList(std::initializer_list<std::size_t> far, SoftListOf<kArrays>* list) {
  for (std::size_t m = list->count; m % kSoftLanes != 0; ++m) {
    for (auto& array : list->v) array[m] = 0;
    for (const std::size_t a : far) list->v[a][m] = 1e15f;
    list->range[m] = 0;
  }
}

// Fills `lists` with the members of the block among the faces of a chunk.
inline void FindFeatures(const SoftChunk& chunk, const SoftMaskPlan& plan, const SoftBox& unit,
                         const SoftBlock& block, const SoftReach& reach, bool split,
                         SoftLists* lists) {
  const SoftTag d;
  const SoftIntTag di;
  lists->vertices.count = lists->segments.count = lists->boundaries.count = 0;
  const auto slots = [&](std::size_t first)
                         HWY_ATTR { return simd::CountFrom(di, static_cast<std::int32_t>(first)); };
  for (std::size_t i = 0; i < chunk.shorts.count; i += hn::Lanes(d)) {
    FaceEdges f;
    LoadCorners(d, chunk.shorts, i, unit, block, &f);
    const SoftMask near =
        hn::And(hn::FirstN(d, chunk.shorts.count - i), IsBoxNear(d, f, block, reach.root));
    if (hn::AllFalse(d, near)) continue;
    ShortEdges(d, chunk.shorts, i, &f);
    AppendFeatures(d, f, near, slots(i), block, reach, unit, split, lists);
  }
  for (std::size_t i = 0; i < chunk.longs.count; i += hn::Lanes(d)) {
    AppendFeatures(d, LongEdges(d, chunk.longs, i, plan, block),
                   hn::FirstN(d, chunk.longs.count - i), slots(kChunkRoom + i), block, reach, unit,
                   split, lists);
  }
  PadList({0}, &lists->vertices);
  PadList({SoftLists::kSide}, &lists->segments);
  PadList({SoftLists::kSide, SoftLists::kEdgeArrays + SoftLists::kSide,
           2 * SoftLists::kEdgeArrays + SoftLists::kSide},
          &lists->boundaries);
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

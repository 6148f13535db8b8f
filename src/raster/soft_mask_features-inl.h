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

// Boxes of faces i, i + 1, ... in pixels.
struct FaceBoxes {
  SoftVec left, top, right, bottom;

  HWY_INLINE FaceBoxes(SoftTag d, const SoftFaceArrays& faces, std::size_t i)
      : left(hn::Load(d, faces.v[SoftFaceArrays::kLeft] + i)),
        top(hn::Load(d, faces.v[SoftFaceArrays::kTop] + i)),
        right(hn::Load(d, faces.v[SoftFaceArrays::kRight] + i)),
        bottom(hn::Load(d, faces.v[SoftFaceArrays::kBottom] + i)) {}
  // Within `reach` of the block's background.
  HWY_INLINE SoftMask IsNear(SoftTag d, const SoftBlock& block, float reach) const {
    return hn::Le(BoxDistance(d, left, top, right, bottom, block.box), hn::Set(d, reach * reach));
  }
};

// The pixels of a block along one axis, in pixels: the centre of the first, and the reach.
struct PixelAxis {
  float first, reach;
};

// Those within reach of the faces' boxes: the first, and 16 times the one behind the last.
HWY_INLINE SoftInt PixelsNear(SoftTag d, SoftVec low, SoftVec high, const PixelAxis& axis) {
  const SoftIntTag di;
  const auto from_first = [&](SoftVec at, float shift) HWY_ATTR {
    return hn::Add(hn::Sub(at, hn::Set(d, axis.first)), hn::Set(d, shift));
  };
  // 1/64 covers rounding, which is relative to pixel numbers up to a few hundred.
  const auto begin = hn::Ceil(from_first(low, -axis.reach - 1.0f / 64));
  const auto end = hn::Floor(from_first(high, axis.reach + (1 + 1.0f / 64)));
  const auto clamp = [&](SoftVec v) HWY_ATTR {
    return hn::ConvertTo(di, hn::Min(hn::Max(v, hn::Zero(d)), hn::Set(d, float{kBlockSize})));
  };
  return hn::Add(clamp(begin), hn::ShiftLeft<4>(clamp(end)));
}

// Bits of the pixels of a SoftList::range.
HWY_INLINE std::uint64_t RangeBits(std::int32_t range) {
  const auto both = static_cast<std::uint32_t>(range);
  return kRangeTables.rows[both & 0xff] & kRangeTables.columns[both >> 8];
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

// Who looks: a block. Faces nearer than `reach.near` go to the boundaries if `split`, whatever is
// seen of them.
struct FeatureSearch {
  const SoftBlock& block;
  const SoftReach& reach;
  bool split;
};

// Appends those of `valid` that are not far.
HWY_INLINE void AppendFeatures(SoftTag d, const FaceEdges& f, const FaceBoxes& boxes,
                               SoftMask valid, SoftInt slot, const FeatureSearch& search,
                               SoftLists* lists) {
  const SoftBlock& block = search.block;
  const SoftReach& reach = search.reach;
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
  if (search.split) far = hn::AndNot(boxes.IsNear(d, block, reach.near), keep);
  const SoftMask corner[3] = {hn::And(start[0], end[2]), hn::And(start[1], end[0]),
                              hn::And(start[2], end[1])};
  const SoftMask edge[3] = {hn::And(start[1], end[2]), hn::And(start[2], end[0]),
                            hn::And(start[0], end[1])};
  const SoftMask vertex = hn::And(far, hn::Or(hn::Or(corner[0], corner[1]), corner[2]));
  const SoftMask segment =
      hn::AndNot(vertex, hn::And(far, hn::Or(hn::Or(edge[0], edge[1]), edge[2])));
  const SoftInt rows =
      PixelsNear(d, boxes.top, boxes.bottom,
                 {static_cast<float>(block.y0) + 0.5f, reach.root / block.box.unit_y});
  const SoftInt columns =
      PixelsNear(d, boxes.left, boxes.right,
                 {static_cast<float>(block.x0) + 0.5f, reach.root / block.box.unit_x});
  const MemberTags tags{slot, hn::Add(rows, hn::ShiftLeft<8>(columns))};
  AppendVertices(d, f, tags, vertex, corner, &lists->vertices);
  AppendEdges(d, f, tags, segment, edge, &lists->segments);
  AppendBoundaries(d, f, tags, hn::AndNot(hn::Or(vertex, segment), keep), &lists->boundaries);
}

// Fills a list up to whole vectors at least: `far` are its arrays of distances.
template <std::size_t kArrays>
HWY_INLINE void PadList(std::initializer_list<std::size_t> far, SoftListOf<kArrays>* list) {
  const SoftTag d;
  const SoftIntTag di;
  for (auto& array : list->v) hn::StoreU(hn::Zero(d), d, array + list->count);
  for (const std::size_t a : far) hn::StoreU(hn::Set(d, 1e15f), d, list->v[a] + list->count);
  hn::StoreU(hn::Zero(di), di, list->range + list->count);
}

// The vectors of faces of which one is near, by its first: no branch, which would be hard to
// foretell. Returns how many.
HWY_INLINE std::size_t FindNear(const SoftFaceArrays& faces, const FeatureSearch& search,
                                std::int32_t* near) {
  const SoftTag d;
  std::size_t count = 0;
  for (std::size_t i = 0; i < faces.count; i += hn::Lanes(d)) {
    near[count] = static_cast<std::int32_t>(i);
    const SoftMask is_near = FaceBoxes(d, faces, i).IsNear(d, search.block, search.reach.root);
    count += BitsOf(d, is_near) != 0;
  }
  return count;
}

// Fills `lists` with the members of the block among the faces of a chunk.
inline void FindFeatures(const SoftChunk& chunk, const SoftMaskPlan& plan,
                         const FeatureSearch& search, SoftLists* lists) {
  const SoftTag d;
  const SoftIntTag di;
  lists->vertices.count = lists->segments.count = lists->boundaries.count = 0;
  const auto append = [&](const SoftFaceArrays& faces, std::size_t i, const FaceEdges& f,
                          std::size_t slot) HWY_ATTR {
    const FaceBoxes boxes(d, faces, i);
    const SoftMask valid =
        hn::And(hn::FirstN(d, faces.count - i), boxes.IsNear(d, search.block, search.reach.root));
    AppendFeatures(d, f, boxes, valid, simd::CountFrom(di, static_cast<std::int32_t>(slot)), search,
                   lists);
  };
  std::int32_t near[kChunkRoom];
  const std::size_t shorts = FindNear(chunk.shorts, search, near);
  for (std::size_t n = 0; n < shorts; ++n) {
    const auto i = static_cast<std::size_t>(near[n]);
    FaceEdges f;
    LoadCorners(d, chunk.shorts, i, search.block, &f), ShortEdges(d, chunk.shorts, i, &f);
    append(chunk.shorts, i, f, i);
  }
  const std::size_t longs = FindNear(chunk.longs, search, near);
  for (std::size_t n = 0; n < longs; ++n) {
    const auto i = static_cast<std::size_t>(near[n]);
    append(chunk.longs, i, LongEdges(d, chunk.longs, i, plan, search.block), kChunkRoom + i);
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

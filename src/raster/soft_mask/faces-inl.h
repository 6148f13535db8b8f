// SPDX-License-Identifier: Apache-2.0
// The faces of a tile, and their edges relative to a block. Lanes are faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_FACES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_FACES_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_FACES_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_FACES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "base/prefetch.h"
#include "base/simd_math-inl.h"
#include "raster/soft_mask/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace simd = tilegrad::HWY_NAMESPACE;

// Corners and boxes, the first of SoftFaceArrays.
inline constexpr std::size_t kCornersAndBoxes = SoftFaceArrays::kLeastSum;

HWY_INLINE void AppendFaces(SoftTag d, const SoftVec (&v)[kCornersAndBoxes], SoftInt face,
                            SoftMask keep, SoftFaceArrays* to) {
  const Compactor compact(d, keep);
  const std::size_t at = to->count;  // in a register
  for (std::size_t a = 0; a < kCornersAndBoxes; ++a) compact.Store(v[a], to->v[a] + at);
  compact.Store(face, to->face + at);
  to->count = at + compact.count();
}

// Appends the faces of a node that are within `z` of the box.
HWY_INLINE void AppendNode(SoftTag d, const SoftTree& tree, std::size_t node, const SoftBox& box,
                           float z, SoftChunk* chunk) {
  const SoftIntTag di;
  const SoftVec limit = hn::Set(d, z), long_edge = hn::Set(d, kLongEdge);
  for (std::size_t f = 0; f < kNodeFaces; f += hn::Lanes(d)) {
    SoftVec v[kCornersAndBoxes];
    for (std::size_t a = 0; a < kCornerNumbers; ++a)
      v[a] = hn::Load(d, tree.corners.at(node, a) + f);
    const SoftVec left = v[SoftFaceArrays::kLeft] = hn::Min(hn::Min(v[0], v[1]), v[2]);
    const SoftVec top = v[SoftFaceArrays::kTop] = hn::Min(hn::Min(v[3], v[4]), v[5]);
    const SoftVec right = v[SoftFaceArrays::kRight] = hn::Max(hn::Max(v[0], v[1]), v[2]);
    const SoftVec bottom = v[SoftFaceArrays::kBottom] = hn::Max(hn::Max(v[3], v[4]), v[5]);
    const auto near = hn::Le(BoxDistance(d, left, top, right, bottom, box), limit);
    if (hn::AllFalse(d, near)) continue;
    const auto is_long = hn::Gt(hn::Max(hn::Sub(right, left), hn::Sub(bottom, top)), long_edge);
    const SoftInt face = simd::CountFrom(di, static_cast<std::int32_t>(node * kNodeFaces + f));
    AppendFaces(d, v, face, hn::AndNot(is_long, near), &chunk->shorts);
    if (hn::AllFalse(d, hn::And(is_long, near))) continue;
    AppendFaces(d, v, face, hn::And(is_long, near), &chunk->longs);
  }
}

// The sine of the turn from edge 0 to edge 1, 0 if it is within its rounding, at most 14 u of 16
// ("Nearest features"), or if one of them is a point.
HWY_INLINE SoftVec TurnOf(SoftTag d, const SoftVec (&tx)[3], const SoftVec (&ty)[3],
                          const SoftVec (&inverse)[3]) {
  const SoftVec sine = hn::MulSub(tx[0], ty[1], hn::Mul(ty[0], tx[1]));
  const SoftMask sure = hn::Gt(hn::Abs(sine), hn::Set(d, 0x1p-20f));
  const SoftMask real = hn::Gt(hn::Min(inverse[0], inverse[1]), hn::Zero(d));
  return hn::IfThenElseZero(hn::And(sure, real), sine);
}

// Directions of the edges of faces that are not long.
HWY_INLINE void SetUpDirections(SoftTag d, float unit_x, float unit_y, SoftFaceArrays* faces) {
  const SoftVec zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const SoftVec ux = hn::Set(d, unit_x), uy = hn::Set(d, unit_y);
  for (std::size_t i = 0; i < faces->count; i += hn::Lanes(d)) {
    SoftVec tx[3], ty[3], inverse[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = k == 2 ? 0 : k + 1;
      const auto span = [&](std::size_t a) HWY_ATTR {
        return hn::Sub(hn::Load(d, faces->v[a + next] + i), hn::Load(d, faces->v[a + k] + i));
      };
      const SoftVec ex = hn::Mul(span(SoftFaceArrays::kX), ux);
      const SoftVec ey = hn::Mul(span(SoftFaceArrays::kY), uy);
      const SoftVec length = hn::Sqrt(hn::MulAdd(ex, ex, hn::Mul(ey, ey)));
      const SoftMask real = hn::Gt(length, zero);
      inverse[k] = hn::IfThenElseZero(real, hn::Div(one, length));
      tx[k] = hn::IfThenElse(real, hn::Mul(ex, inverse[k]), one);
      ty[k] = hn::Mul(ey, inverse[k]);
      hn::Store(tx[k], d, faces->v[SoftFaceArrays::kTx + k] + i);
      hn::Store(ty[k], d, faces->v[SoftFaceArrays::kTy + k] + i);
      hn::Store(inverse[k], d, faces->v[SoftFaceArrays::kInverse + k] + i);
    }
    hn::Store(TurnOf(d, tx, ty, inverse), d, faces->v[SoftFaceArrays::kTurn] + i);
  }
}

// The diagonal bounds that make octagons of boxes.
HWY_INLINE void SetUpDiagonals(SoftTag d, SoftFaceArrays* faces) {
  for (std::size_t i = 0; i < faces->count; i += hn::Lanes(d)) {
    SoftVec sum[3], difference[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const SoftVec x = hn::Load(d, faces->v[SoftFaceArrays::kX + k] + i);
      const SoftVec y = hn::Load(d, faces->v[SoftFaceArrays::kY + k] + i);
      sum[k] = hn::Add(x, y);
      difference[k] = hn::Sub(x, y);
    }
    const auto store = [&](const SoftVec(&v)[3], SoftFaceArrays::Array least,
                           SoftFaceArrays::Array most) HWY_ATTR {
      hn::Store(hn::Min(hn::Min(v[0], v[1]), v[2]), d, faces->v[least] + i);
      hn::Store(hn::Max(hn::Max(v[0], v[1]), v[2]), d, faces->v[most] + i);
    };
    store(sum, SoftFaceArrays::kLeastSum, SoftFaceArrays::kMostSum);
    store(difference, SoftFaceArrays::kLeastDifference, SoftFaceArrays::kMostDifference);
  }
}

// Faces with long edges have none: sums of large coordinates are not precise enough.
HWY_INLINE void ForgetDiagonals(SoftTag d, SoftFaceArrays* faces) {
  for (std::size_t i = 0; i < faces->count; i += hn::Lanes(d)) {
    for (const auto least : {SoftFaceArrays::kLeastSum, SoftFaceArrays::kLeastDifference}) {
      hn::Store(hn::Set(d, -kNowhere), d, faces->v[least] + i);
    }
    for (const auto most : {SoftFaceArrays::kMostSum, SoftFaceArrays::kMostDifference}) {
      hn::Store(hn::Set(d, kNowhere), d, faces->v[most] + i);
    }
  }
}

HWY_INLINE void PrefetchNode(const SoftTree& tree, std::size_t node) {
  PrefetchNumbers(tree.corners.at(node, 0), kCornerNumbers * kNodeFaces);
}

// The faces that a tile visits: those of `nodes` within z of the box, up to `most` at a time.
struct TileFaces {
  const SoftTree& tree;
  std::span<const std::int32_t> nodes;
  const SoftBox& box;
  float z;
  std::size_t most;
};

// Fills the chunk with the next faces, from nodes[*next] on.
inline void FillChunk(const TileFaces& faces, std::size_t* next, SoftChunk* chunk) {
  const auto& [tree, nodes, box, z, most] = faces;
  const SoftTag d;
  constexpr std::size_t kAhead = 4;  // nodes are scattered in memory
  chunk->shorts.count = chunk->longs.count = 0;
  while (*next < nodes.size() && chunk->shorts.count + chunk->longs.count + kNodeFaces <= most) {
    if (*next + kAhead < nodes.size()) {
      PrefetchNode(tree, static_cast<std::size_t>(nodes[*next + kAhead]));
    }
    AppendNode(d, tree, static_cast<std::size_t>(nodes[(*next)++]), box, z, chunk);
  }
  SetUpDirections(d, box.unit_x, box.unit_y, &chunk->shorts);
  SetUpDiagonals(d, &chunk->shorts);
  ForgetDiagonals(d, &chunk->longs);
}

// Faces relative to the centre of a block's background: corners, and the position of that centre
// relative to each edge ("The distance to a boundary").
struct FaceEdges {
  SoftVec x[3], y[3];
  SoftVec tx[3], ty[3], side[3], first[3], last[3], inverse[3];
  SoftVec turn;
};

HWY_INLINE void LoadCorners(SoftTag d, const SoftFaceArrays& faces, std::size_t i,
                            const SoftBlock& block, FaceEdges* f) {
  for (std::size_t k = 0; k < 3; ++k) {
    const auto from = [&](std::size_t a, float centre, float scale) HWY_ATTR {
      return hn::Mul(hn::Sub(hn::Load(d, faces.v[a + k] + i), hn::Set(d, centre)),
                     hn::Set(d, scale));
    };
    f->x[k] = from(SoftFaceArrays::kX, block.centre_x, block.box.unit_x);
    f->y[k] = from(SoftFaceArrays::kY, block.centre_y, block.box.unit_y);
  }
}

// The edges between the corners in `f`.
HWY_INLINE void ShortEdges(SoftTag d, const SoftFaceArrays& faces, std::size_t i, FaceEdges* f) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = k == 2 ? 0 : k + 1;
    const SoftVec tx = f->tx[k] = hn::Load(d, faces.v[SoftFaceArrays::kTx + k] + i);
    const SoftVec ty = f->ty[k] = hn::Load(d, faces.v[SoftFaceArrays::kTy + k] + i);
    f->side[k] = hn::MulSub(ty, f->x[k], hn::Mul(tx, f->y[k]));
    f->first[k] = hn::MulAdd(tx, f->x[k], hn::Mul(ty, f->y[k]));
    f->last[k] = hn::MulAdd(tx, f->x[next], hn::Mul(ty, f->y[next]));
    f->inverse[k] = hn::Load(d, faces.v[SoftFaceArrays::kInverse + k] + i);
  }
  f->turn = hn::Load(d, faces.v[SoftFaceArrays::kTurn] + i);
}

using SoftDoubleTag = hn::CappedTag<double, kSoftLanes / 2>;
using SoftDouble = hn::Vec<SoftDoubleTag>;
using SoftNarrowTag = hn::Rebind<float, SoftDoubleTag>;  // as many floats

// Stays finite, and its square is at most infinite.
HWY_INLINE void StoreNarrow(SoftDouble v, float* to) {
  const SoftDoubleTag d;
  const SoftDouble most = hn::Set(d, 1e30);
  hn::StoreU(hn::DemoteTo(SoftNarrowTag(), hn::Min(hn::Max(v, hn::Neg(most)), most)),
             SoftNarrowTag(), to);
}

// The fields of FaceEdges, array by array.
struct LongFaces {
  enum Array { kX = 0, kY = 3, kEdges = 6, kArrays = 24 };
  alignas(64) float v[kArrays][kSoftLanes];
};

// Edge k of the faces with corners x, y, in double: a difference of large numbers. Written to lanes
// `at`.
HWY_INLINE void LongEdge(const SoftDouble (&x)[3], const SoftDouble (&y)[3], std::size_t k,
                         std::size_t at, LongFaces* out) {
  const SoftDoubleTag d;
  const SoftDouble zero = hn::Zero(d), one = hn::Set(d, 1.0);
  const std::size_t next = k == 2 ? 0 : k + 1;
  const SoftDouble ex = hn::Sub(x[next], x[k]), ey = hn::Sub(y[next], y[k]);
  const SoftDouble length = hn::Sqrt(hn::MulAdd(ex, ex, hn::Mul(ey, ey)));
  const auto real = hn::Gt(length, zero);
  const SoftDouble inverse = hn::IfThenElseZero(real, hn::Div(one, length));
  const SoftDouble tx = hn::IfThenElse(real, hn::Mul(ex, inverse), one);
  const SoftDouble ty = hn::Mul(ey, inverse);
  const SoftDouble side = hn::MulSub(ty, x[k], hn::Mul(tx, y[k]));
  const SoftDouble first = hn::MulAdd(tx, x[k], hn::Mul(ty, y[k]));
  const SoftDouble edge[] = {tx, ty, side, first, hn::Add(first, length), inverse};
  for (std::size_t a = 0; a < 6; ++a) {
    StoreNarrow(edge[a], out->v[LongFaces::kEdges + 6 * k + a] + at);
  }
}

// The same for faces with long edges.
HWY_INLINE FaceEdges LongEdges(SoftTag d, const SoftFaceArrays& faces, std::size_t i,
                               const SoftMaskPlan& plan, const SoftBlock& block) {
  const SoftDoubleTag dd;
  const SoftNarrowTag d_narrow;
  LongFaces lanes;
  for (std::size_t at = 0; at < hn::Lanes(d); at += hn::Lanes(dd)) {
    SoftDouble x[3], y[3];
    const auto from = [&](const float* corners, float centre, double unit) HWY_ATTR {
      const auto corner = hn::PromoteTo(dd, hn::Load(d_narrow, corners + i + at));
      return hn::Mul(hn::Sub(corner, hn::Set(dd, static_cast<double>(centre))), hn::Set(dd, unit));
    };
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = from(faces.v[SoftFaceArrays::kX + k], block.centre_x, plan.unit_x);
      y[k] = from(faces.v[SoftFaceArrays::kY + k], block.centre_y, plan.unit_y);
      StoreNarrow(x[k], lanes.v[LongFaces::kX + k] + at);
      StoreNarrow(y[k], lanes.v[LongFaces::kY + k] + at);
    }
    for (std::size_t k = 0; k < 3; ++k) LongEdge(x, y, k, at, &lanes);
  }
  FaceEdges f;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto edge = [&](std::size_t a)
                          HWY_ATTR { return hn::Load(d, lanes.v[LongFaces::kEdges + 6 * k + a]); };
    f.x[k] = hn::Load(d, lanes.v[LongFaces::kX + k]);
    f.y[k] = hn::Load(d, lanes.v[LongFaces::kY + k]);
    f.tx[k] = edge(0);
    f.ty[k] = edge(1);
    f.side[k] = edge(2);
    f.first[k] = edge(3);
    f.last[k] = edge(4);
    f.inverse[k] = edge(5);
  }
  f.turn = TurnOf(d, f.tx, f.ty, f.inverse);
  return f;
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// The soft mask's faces per tile and per block, in double; lanes over faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_GATHER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_GATHER_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_GATHER_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_GATHER_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstring>

#include "raster/soft_mask_block.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using GatherTag = hn::CappedTag<double, 4>;
using GatherVec = hn::Vec<GatherTag>;
using GatherMask = hn::Mask<GatherTag>;
using GatherFloatTag = hn::Rebind<float, GatherTag>;
inline constexpr std::size_t kGatherMost = 4;  // lanes

// Bit i: lane i.
HWY_INLINE std::uint32_t BitsOf(GatherTag d, GatherMask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0];
}

HWY_INLINE GatherVec Square(GatherVec v) { return hn::Mul(v, v); }

HWY_INLINE GatherVec Gap(GatherTag d, GatherVec low, GatherVec high, double centre, double half) {
  const auto below = hn::Sub(low, hn::Set(d, centre + half));
  const auto above = hn::Sub(hn::Set(d, centre - half), high);
  return hn::Max(hn::Max(below, above), hn::Zero(d));
}

// Points of the box may be within sqrt(z) of the face's box, given by its sides.
HWY_INLINE GatherMask IsBoxNear(GatherTag d, const GatherVec (&side)[4], const SoftBox& box) {
  const auto gx = Gap(d, side[0], side[2], box.x, box.half_x);
  const auto gy = Gap(d, side[1], side[3], box.y, box.half_y);
  return hn::Le(hn::MulAdd(gx, gx, Square(gy)), hn::Set(d, box.z));
}

// Corners of a vector of faces in kernel units from the tile's centre; the last face again where
// there is none.
HWY_INLINE void LoadCorners(GatherTag d, const ScreenMesh& mesh, const SoftFrame& frame,
                            std::span<const std::int32_t> faces, std::size_t n,
                            GatherVec (&corner)[6]) {
  const GatherFloatTag df;
  const hn::RebindToSigned<GatherFloatTag> di;
  const std::size_t lanes = hn::Lanes(di);
  HWY_ALIGN std::int32_t last[kGatherMost];
  const std::int32_t* listed = faces.data() + n;
  if (n + lanes > faces.size()) {
    for (std::size_t i = 0; i < lanes; ++i) last[i] = faces[HWY_MIN(n + i, faces.size() - 1)];
    listed = last;
  }
  const auto face = hn::LoadU(di, listed);
  const auto units = [&](const float* at, hn::Vec<decltype(di)> v, double origin, double unit)
                         HWY_ATTR {
                           const auto pixels = hn::PromoteTo(d, hn::GatherIndex(df, at, v));
                           return hn::Mul(hn::Sub(pixels, hn::Set(d, origin)), hn::Set(d, unit));
                         };
  const std::int32_t* const vertices[3] = {mesh.v0.data(), mesh.v1.data(), mesh.v2.data()};
  for (int k = 0; k < 3; ++k) {
    const auto v = hn::GatherIndex(di, vertices[k], face);
    corner[k] = units(mesh.x.data(), v, frame.x, frame.unit_x);
    corner[3 + k] = units(mesh.y.data(), v, frame.y, frame.unit_y);
  }
}

// Appends the lanes of `keep`: boxes, corners and position n + lane. By way of memory, since
// compressing doubles loads a large table on some targets.
HWY_INLINE void AppendLanes(GatherTag d, const GatherVec (&side)[4], const GatherVec (&corner)[6],
                            std::size_t n, std::uint32_t keep, SoftFaces* out) {
  if (keep == 0) return;
  HWY_ALIGN double lanes[10][kGatherMost];
  for (int a = 0; a < 4; ++a) hn::Store(side[a], d, lanes[a]);
  for (int a = 0; a < 6; ++a) hn::Store(corner[a], d, lanes[4 + a]);
  static_assert(SoftFaces::kLeft + 4 == SoftFaces::kEdges);
  for (; keep != 0; keep &= keep - 1) {
    const std::size_t lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(keep);
    double* to = out->array(SoftFaces::kLeft) + out->count;
    for (std::size_t a = 0; a < 10; ++a) to[a * out->stride] = lanes[a][lane];
    out->array(SoftFaces::kPosition)[out->count++] = static_cast<double>(n + lane);
  }
}

// Keeps the faces of a tile that are not far: their boxes, and their corners in place of edge 0.
inline void KeepNearFaces(const ScreenMesh& mesh, const SoftFrame& frame,
                          std::span<const std::int32_t> faces, const SoftBox& box, SoftFaces* out) {
  const GatherTag d;
  for (std::size_t n = 0; n < faces.size(); n += hn::Lanes(d)) {
    GatherVec c[6], side[4];
    LoadCorners(d, mesh, frame, faces, n, c);
    for (int a = 0; a < 2; ++a) {
      side[a] = hn::Min(hn::Min(c[3 * a], c[3 * a + 1]), c[3 * a + 2]);
      side[2 + a] = hn::Max(hn::Max(c[3 * a], c[3 * a + 1]), c[3 * a + 2]);
    }
    const auto keep = hn::And(IsBoxNear(d, side, box), hn::FirstN(d, faces.size() - n));
    AppendLanes(d, side, c, n, BitsOf(d, keep), out);
  }
}

HWY_INLINE void StoreEdge(GatherTag d, const GatherVec (&c)[6], int k, std::size_t i,
                          SoftFaces* out) {
  const int next = k == 2 ? 0 : k + 1;
  const auto ex = hn::Sub(c[next], c[k]), ey = hn::Sub(c[3 + next], c[3 + k]);
  const auto length = hn::Sqrt(hn::MulAdd(ex, ex, Square(ey)));
  const auto real = hn::Gt(length, hn::Zero(d));
  const auto inverse = hn::IfThenElseZero(real, hn::Div(hn::Set(d, 1.0), length));
  const auto tx = hn::IfThenElse(real, hn::Mul(ex, inverse), hn::Set(d, 1.0));
  const auto ty = hn::Mul(ey, inverse);
  const auto store = [&](SoftFaces::EdgeArray a, GatherVec v)
                         HWY_ATTR { hn::StoreU(v, d, out->array(SoftFaces::Edge(k, a)) + i); };
  store(SoftFaces::kTx, tx), store(SoftFaces::kTy, ty);
  store(SoftFaces::kSide, hn::NegMulAdd(tx, c[3 + k], hn::Mul(ty, c[k])));
  store(SoftFaces::kAlong, hn::Neg(hn::MulAdd(tx, c[k], hn::Mul(ty, c[3 + k]))));
  store(SoftFaces::kLength, length), store(SoftFaces::kInverseLength, inverse);
}

// The faces of a tile, except those that are far from `box`.
inline void SoftTileFaces(const ScreenMesh& mesh, const SoftFrame& frame,
                          std::span<const std::int32_t> faces, const SoftBox& box, SoftFaces* out) {
  const GatherTag d;
  out->Reserve(faces.size()), out->count = 0;
  KeepNearFaces(mesh, frame, faces, box, out);
  for (std::size_t i = 0; i < out->count; i += hn::Lanes(d)) {
    GatherVec c[6];
    for (std::size_t k = 0; k < 6; ++k) c[k] = hn::LoadU(d, out->array(SoftFaces::kEdges + k) + i);
    for (int k = 0; k < 3; ++k) StoreEdge(d, c, k, i, out);
  }
}

// Edge k of a vector of faces, seen from a point: `side` and `along` there.
struct EdgeLanes {
  GatherVec tx, ty, side, along, past;
};

HWY_INLINE EdgeLanes EdgeFrom(GatherTag d, const SoftFaces& faces, int k, std::size_t i, double x,
                              double y) {
  const auto load = [&](SoftFaces::EdgeArray a)
                        HWY_ATTR { return hn::Load(d, faces.array(SoftFaces::Edge(k, a)) + i); };
  const auto px = hn::Set(d, x), py = hn::Set(d, y);
  EdgeLanes e{load(SoftFaces::kTx), load(SoftFaces::kTy), {}, {}, {}};
  e.side = hn::NegMulAdd(e.ty, px, hn::MulAdd(e.tx, py, load(SoftFaces::kSide)));
  e.along = hn::MulAdd(e.tx, px, hn::MulAdd(e.ty, py, load(SoftFaces::kAlong)));
  e.past = hn::Sub(e.along, load(SoftFaces::kLength));
  return e;
}

// The boundary of the face may be within the box's reach of its middle.
HWY_INLINE GatherMask IsBoundaryNear(GatherTag d, const SoftFaces& faces, std::size_t i,
                                     const SoftBox& box) {
  const auto squared = [&](int k) HWY_ATTR {
    const EdgeLanes e = EdgeFrom(d, faces, k, i, box.x, box.y);
    const auto beyond = hn::Add(hn::Max(e.past, hn::Zero(d)), hn::Min(e.along, hn::Zero(d)));
    return hn::MulAdd(e.side, e.side, Square(beyond));
  };
  const auto nearest = hn::Min(hn::Min(squared(0), squared(1)), squared(2));
  return hn::Le(nearest, hn::Set(d, box.reach));
}

// Finite, and its square is at most infinite.
HWY_INLINE hn::Vec<GatherFloatTag> ToFloats(GatherTag d, GatherVec v) {
  const auto most = hn::Set(d, 1e30);
  return hn::DemoteTo(GatherFloatTag(), hn::Min(hn::Max(v, hn::Neg(most)), most));
}

// SoftBlockFaces from face i on, seen from (x, y), as five pieces of four numbers each.
struct FacePieces {
  HWY_ALIGN float numbers[5][4 * kGatherMost];
  static_assert(sizeof(SoftBlockFace) == 5 * 4 * sizeof(float));

  void CopyTo(std::size_t lane, SoftBlockFace* to) const {
    auto* bytes = reinterpret_cast<char*>(to);
    for (std::size_t p = 0; p < 5; ++p) {
      std::memcpy(bytes + 4 * p * sizeof(float), numbers[p] + 4 * lane, 4 * sizeof(float));
    }
  }
};

HWY_INLINE void MakePieces(GatherTag d, const SoftFaces& faces, std::size_t i, double x, double y,
                           FacePieces* out) {
  const GatherFloatTag df;
  const hn::Rebind<std::int32_t, GatherTag> di;
  hn::Vec<GatherFloatTag> v[20];
  for (int k = 0; k < 3; ++k) {
    const EdgeLanes e = EdgeFrom(d, faces, k, i, x, y);
    v[6 * k] = hn::DemoteTo(df, e.tx), v[6 * k + 1] = hn::DemoteTo(df, e.ty);
    v[6 * k + 2] = ToFloats(d, e.side), v[6 * k + 3] = ToFloats(d, e.along);
    v[6 * k + 4] = ToFloats(d, e.past);
    v[6 * k + 5] =
        ToFloats(d, hn::Load(d, faces.array(SoftFaces::Edge(k, SoftFaces::kInverseLength)) + i));
  }
  const auto position = hn::DemoteTo(di, hn::Load(d, faces.array(SoftFaces::kPosition) + i));
  v[18] = hn::BitCast(df, position), v[19] = hn::Zero(df);
  for (std::size_t p = 0; p < 5; ++p) {
    hn::StoreInterleaved4(v[4 * p], v[4 * p + 1], v[4 * p + 2], v[4 * p + 3], df, out->numbers[p]);
  }
}

// Fills `members` with the faces that are not far from `box`, a block's background, as seen from
// the block's centre. Returns their number.
inline std::size_t SoftBlockMembers(const SoftFaces& faces, const SoftBox& box,
                                    const SoftPoint& centre, SoftBlockFace* members) {
  const GatherTag d;
  std::size_t count = 0;
  for (std::size_t i = 0; i < faces.count; i += hn::Lanes(d)) {
    GatherVec side[4];
    for (std::size_t k = 0; k < 4; ++k) {
      side[k] = hn::Load(d, faces.array(SoftFaces::kLeft + k) + i);
    }
    const auto boxes = hn::And(IsBoxNear(d, side, box), hn::FirstN(d, faces.count - i));
    if (hn::AllFalse(d, boxes)) continue;
    std::uint32_t near = BitsOf(d, hn::And(boxes, IsBoundaryNear(d, faces, i, box)));
    if (near == 0) continue;
    FacePieces pieces;
    MakePieces(d, faces, i, centre.x, centre.y, &pieces);
    for (; near != 0; near &= near - 1) {
      pieces.CopyTo(hwy::Num0BitsBelowLS1Bit_Nonzero32(near), &members[count++]);
    }
  }
  return count;
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

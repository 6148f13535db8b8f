// SPDX-License-Identifier: Apache-2.0
// Set-up of small faces for visibility; lanes are faces. A face is small if its corners lie within
// kSmallReach of the tile's centre: then its exact edge functions fit into 32 bits. The same
// numbers, bit by bit, as SetUpTileFace (no fused operations).
#if defined(TILEGRAD_RASTER_VISIBILITY_SETUP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_VISIBILITY_SETUP_INL_H_
#undef TILEGRAD_RASTER_VISIBILITY_SETUP_INL_H_
#else
#define TILEGRAD_RASTER_VISIBILITY_SETUP_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <span>

#include "raster/tile_face_setup.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SetupTag = HWY_CAPPED(float, kSetupLanes);
using SetupIntTag = hn::RebindToSigned<SetupTag>;
using SetupVec = hn::Vec<SetupTag>;
using SetupInt = hn::Vec<SetupIntTag>;
using SetupIntMask = hn::Mask<SetupIntTag>;

struct SetupCorners {
  SetupVec x[3], y[3], z[3];
};

HWY_INLINE SetupCorners GatherSetupCorners(const ScreenMesh& mesh, SetupInt face) {
  const SetupTag d;
  const SetupIntTag di;
  SetupCorners out;
  const std::int32_t* const corners[3] = {mesh.v0.data(), mesh.v1.data(), mesh.v2.data()};
  for (int k = 0; k < 3; ++k) {
    const auto v = hn::GatherIndex(di, corners[k], face);
    out.x[k] = hn::GatherIndex(d, mesh.x.data(), v);
    out.y[k] = hn::GatherIndex(d, mesh.y.data(), v);
    out.z[k] = hn::GatherIndex(d, mesh.inverse_depth.data(), v);
  }
  return out;
}

// Corners in subpixels from the centre of the tile's first pixel. What is too large to be small
// saturates and stays large.
struct SnappedLanes {
  SetupInt x[3], y[3];
  SetupIntMask small;
};

HWY_INLINE SetupInt SnapFrom(SetupVec pixels, int origin) {
  const SetupTag d;
  const SetupIntTag di;
  const auto most = hn::Set(d, 0x1p30f);
  const auto scaled = hn::Mul(pixels, hn::Set(d, static_cast<float>(kSubpixels)));
  const auto snapped = hn::NearestInt(hn::Min(hn::Max(scaled, hn::Neg(most)), most));
  return hn::Sub(snapped, hn::Set(di, static_cast<std::int32_t>(CentreSubpixel(origin))));
}

HWY_INLINE SnappedLanes SnapLanes(const SetupCorners& c, const TileRect& rect) {
  const SetupIntTag di;
  constexpr std::int32_t kCentre = (kTileSize - 1) * static_cast<std::int32_t>(kSubpixels) / 2;
  // 16 pixels: differences of coordinates are at most 2^15, and distances to the first centre at
  // most 24,064, so that an edge function there is at most 2^15 * 2 * 24,064 < 2^31.
  constexpr std::int32_t kSmallReach = 1 << 14;
  SnappedLanes out;
  auto farthest = hn::Zero(di);
  for (int k = 0; k < 3; ++k) {
    out.x[k] = SnapFrom(c.x[k], rect.x0), out.y[k] = SnapFrom(c.y[k], rect.y0);
    farthest = hn::Max(farthest, hn::Abs(hn::Sub(out.x[k], hn::Set(di, kCentre))));
    farthest = hn::Max(farthest, hn::Abs(hn::Sub(out.y[k], hn::Set(di, kCentre))));
  }
  out.small = hn::Lt(farthest, hn::Set(di, kSmallReach + 1));
  return out;
}

// Corners 1 and 2 change places where the doubled area is negative.
HWY_INLINE void WindClockwise(SnappedLanes* s) {
  const auto area = hn::Sub(hn::Mul(hn::Sub(s->x[1], s->x[0]), hn::Sub(s->y[2], s->y[0])),
                            hn::Mul(hn::Sub(s->x[2], s->x[0]), hn::Sub(s->y[1], s->y[0])));
  const auto swap = hn::Lt(area, hn::Zero(SetupIntTag()));
  for (auto* a : {s->x, s->y}) {
    const auto first = a[1];
    a[1] = hn::IfThenElse(swap, a[2], first), a[2] = hn::IfThenElse(swap, first, a[2]);
  }
}

HWY_INLINE void StoreEdges(const SnappedLanes& s, TileFaceBatch* out) {
  const SetupIntTag di;
  const auto zero = hn::Zero(di);
  for (int k = 0; k < 3; ++k) {
    const int n = k == 2 ? 0 : k + 1;
    const auto dx = hn::Sub(s.x[n], s.x[k]), dy = hn::Sub(s.y[n], s.y[k]);
    const auto left_or_top = hn::Or(hn::Lt(dy, zero), hn::And(hn::Eq(dy, zero), hn::Gt(dx, zero)));
    const auto at = hn::Sub(hn::Mul(dy, s.x[k]), hn::Mul(dx, s.y[k]));
    const auto exact = hn::Add(at, hn::IfThenZeroElse(left_or_top, hn::Set(di, -1)));
    hn::Store(hn::ShiftRight<kSubpixelBits>(exact), di, out->edge[k]);
    hn::Store(hn::Neg(dy), di, out->step_x[k]), hn::Store(dx, di, out->step_y[k]);
  }
}

// Pixels [begin, end) of the tile along one axis whose centre lies in the face's box.
HWY_INLINE void StoreRange(const SetupInt (&c)[3], int size, std::int32_t* begin,
                           std::int32_t* end) {
  const SetupIntTag di;
  const auto low = hn::Min(hn::Min(c[0], c[1]), c[2]), high = hn::Max(hn::Max(c[0], c[1]), c[2]);
  const auto clamp = [&](SetupInt v)
                         HWY_ATTR { return hn::Min(hn::Max(v, hn::Zero(di)), hn::Set(di, size)); };
  const auto round_up = hn::Set(di, static_cast<std::int32_t>(kSubpixels) - 1);
  hn::Store(clamp(hn::ShiftRight<kSubpixelBits>(hn::Add(low, round_up))), di, begin);
  hn::Store(clamp(hn::Add(hn::ShiftRight<kSubpixelBits>(high), hn::Set(di, 1))), di, end);
}

// SwapUnlessOrdered of face_plane.h.
HWY_INLINE void OrderLanes(SetupCorners* c, int i, int j) {
  const auto ordered =
      hn::Or(hn::Lt(c->x[i], c->x[j]), hn::And(hn::Eq(c->x[i], c->x[j]), hn::Le(c->y[i], c->y[j])));
  for (auto* a : {c->x, c->y, c->z}) {
    const auto first = a[i];
    a[i] = hn::IfThenElse(ordered, first, a[j]), a[j] = hn::IfThenElse(ordered, a[j], first);
  }
}

// MakeDepthPlane of face_plane.h, in the same order of operations.
HWY_INLINE void StoreDepth(SetupCorners c, TileFaceBatch* out) {
  const SetupTag d;
  OrderLanes(&c, 0, 1), OrderLanes(&c, 1, 2), OrderLanes(&c, 0, 1);
  const auto x1 = hn::Sub(c.x[1], c.x[0]), y1 = hn::Sub(c.y[1], c.y[0]);
  const auto x2 = hn::Sub(c.x[2], c.x[0]), y2 = hn::Sub(c.y[2], c.y[0]);
  const auto x3 = hn::Sub(x2, x1), y3 = hn::Sub(y2, y1);
  const auto area = hn::Sub(hn::Mul(x1, y2), hn::Mul(x2, y1));
  const auto square = [&](SetupVec x, SetupVec y)
                          HWY_ATTR { return hn::Add(hn::Mul(x, x), hn::Mul(y, y)); };
  const auto longest = hn::Max(hn::Max(square(x1, y1), square(x2, y2)), square(x3, y3));
  constexpr auto kThin = static_cast<float>(kFlatHeight * kFlatHeight);
  const auto solid = hn::Gt(hn::Mul(area, area), hn::Mul(hn::Set(d, kThin), longest));
  const auto inverse = hn::IfThenElseZero(solid, hn::Div(hn::Set(d, 1.0f), area));
  const auto slope = [&](SetupVec g1, SetupVec g2) HWY_ATTR {
    const auto g0 = hn::Neg(hn::Add(g1, g2));
    const auto first = hn::Add(hn::Mul(g0, c.z[0]), hn::Mul(g1, c.z[1]));
    return hn::IfThenElseZero(solid, hn::Add(first, hn::Mul(g2, c.z[2])));
  };
  const auto third = hn::Set(d, 1.0f / 3.0f);
  const auto mean =
      hn::Add(hn::Add(hn::Mul(third, c.z[0]), hn::Mul(third, c.z[1])), hn::Mul(third, c.z[2]));
  hn::Store(c.x[0], d, out->x0), hn::Store(c.y[0], d, out->y0);
  hn::Store(hn::IfThenElse(solid, c.z[0], mean), d, out->base);
  hn::Store(slope(hn::Mul(y2, inverse), hn::Mul(hn::Neg(y1), inverse)), d, out->gx);
  hn::Store(slope(hn::Mul(hn::Neg(x2), inverse), hn::Mul(x1, inverse)), d, out->gy);
  hn::Store(hn::Min(hn::Min(c.z[0], c.z[1]), c.z[2]), d, out->low);
  hn::Store(hn::Max(hn::Max(c.z[0], c.z[1]), c.z[2]), d, out->high);
}

// Sets up faces[0] to at most faces[kSetupLanes - 1]. Returns how many.
inline std::size_t SetUpBatch(const ScreenMesh& mesh, std::span<const std::int32_t> faces,
                              const TileRect& rect, TileFaceBatch* out) {
  const SetupIntTag di;
  const std::size_t lanes = hn::Lanes(di), count = HWY_MIN(lanes, faces.size());
  for (std::size_t i = 0; i < lanes; ++i) out->face[i] = faces[HWY_MIN(i, count - 1)];
  const SetupCorners corners = GatherSetupCorners(mesh, hn::Load(di, out->face));
  SnappedLanes snapped = SnapLanes(corners, rect);
  hn::Store(hn::VecFromMask(di, snapped.small), di, out->small);
  if (hn::AllFalse(di, snapped.small)) return count;
  WindClockwise(&snapped);
  StoreEdges(snapped, out);
  StoreRange(snapped.x, rect.x1 - rect.x0, out->column_begin, out->column_end);
  StoreRange(snapped.y, rect.y1 - rect.y0, out->row_begin, out->row_end);
  StoreDepth(corners, out);
  return count;
}

// Face i of a batch, if its box holds a pixel centre of the tile.
HWY_INLINE bool FromBatch(const TileFaceBatch& batch, std::size_t i, TileFaceSetup* out) {
  out->column_begin = batch.column_begin[i], out->column_end = batch.column_end[i];
  out->row_begin = batch.row_begin[i], out->row_end = batch.row_end[i];
  if (out->column_begin >= out->column_end || out->row_begin >= out->row_end) return false;
  out->face = batch.face[i], out->guarded = true;
  for (int k = 0; k < 3; ++k) {
    out->edge[k] = batch.edge[k][i];
    out->step_x[k] = batch.step_x[k][i], out->step_y[k] = batch.step_y[k][i];
  }
  out->depth = {batch.x0[i], batch.y0[i],  batch.base[i], batch.gx[i],
                batch.gy[i], batch.low[i], batch.high[i]};
  return true;
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of visibility.h. Lanes are the pixels of a row. A face walks only the columns and
// rows of its own box, so small faces take one vector per row and large ones whole rows; a face
// that covers the whole tile raises the depth floor below which later faces are rejected unseen.
#if defined(TILEGRAD_RASTER_VISIBILITY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_VISIBILITY_INL_H_
#undef TILEGRAD_RASTER_VISIBILITY_INL_H_
#else
#define TILEGRAD_RASTER_VISIBILITY_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "raster/tile_face_setup.h"
#include "raster/visibility.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using VisibilityTag = HWY_CAPPED(float, kTileSize);
using VisibilityIntTag = hn::RebindToSigned<VisibilityTag>;

// One vector of columns, from `column` on, of every row of the face's box.
// Mul and Add are kept apart (no fused MulAdd): the same bits on every instruction set.
HWY_INLINE void DrawColumns(const TileFaceSetup& face, int column, const TileRect& rect,
                            VisibilityTile* out) {
  const VisibilityTag d;
  const VisibilityIntTag di;
  const auto columns = hn::Iota(di, column);
  hn::Vec<VisibilityIntTag> edge[3], step[3];
  for (int k = 0; k < 3; ++k) {
    const auto start = hn::Set(di, face.edge[k] + face.step_y[k] * face.row_begin);
    edge[k] = hn::Add(start, hn::Mul(hn::Set(di, face.step_x[k]), columns));
    step[k] = hn::Set(di, face.step_y[k]);
  }
  const auto& plane = face.depth;
  const auto px = hn::Add(hn::Iota(d, static_cast<float>(rect.x0 + column)), hn::Set(d, 0.5f));
  const auto dx = hn::Mul(hn::Set(d, plane.gx), hn::Sub(px, hn::Set(d, plane.x0)));
  const auto low = hn::Set(d, plane.low), high = hn::Set(d, plane.high);
  const auto base = hn::Set(d, plane.base);
  const auto id = hn::Set(di, face.face);
  for (int i = face.row_begin; i < face.row_end; ++i) {
    const auto inside = hn::Gt(hn::Or(hn::Or(edge[0], edge[1]), edge[2]), hn::Set(di, -1));
    for (int k = 0; k < 3; ++k) edge[k] = hn::Add(edge[k], step[k]);
    const float py = static_cast<float>(rect.y0 + i) + 0.5f;
    const auto dy = hn::Set(d, plane.gy * (py - plane.y0));
    const auto z = hn::Min(hn::Max(hn::Add(base, hn::Add(dx, dy)), low), high);
    float* nearest = out->inverse_depth + i * kTileSize + column;
    std::int32_t* ids = out->face + i * kTileSize + column;
    const auto old = hn::LoadU(d, nearest);
    const auto seen = hn::And(hn::RebindMask(d, inside), hn::Gt(z, old));
    hn::StoreU(hn::IfThenElse(seen, z, old), d, nearest);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, seen), id, hn::LoadU(di, ids)), di, ids);
  }
}

// `floor`: every pixel of the tile is at least this near.
HWY_INLINE void DrawFace(const ScreenMesh& mesh, const TileFaceSetup& face, const TileRect& rect,
                         float* floor, VisibilityTile* out) {
  const int lanes = static_cast<int>(hn::Lanes(VisibilityTag()));
  if (face.depth.high <= *floor) return;
  if (!face.guarded) {
    DrawUnguarded(mesh, face, rect, out);
    return;
  }
  if (face.CoversTile()) *floor = HWY_MAX(*floor, face.depth.low);
  int column = HWY_MIN(face.column_begin, kTileSize - lanes);
  for (; column < face.column_end; column += lanes) {
    DrawColumns(face, HWY_MIN(column, kTileSize - lanes), rect, out);
  }
}

// Moves a small face's edge functions to the tile's corner, and cuts its box by the tile. No
// overflow: they are below 2^21 in the box, and 46 pixels, of steps up to 2^15, away from it at
// most.
HWY_INLINE TileFaceSetup InTile(const DrawnFace& drawn, const TileRect& rect) {
  TileFaceSetup out;
  out.face = drawn.face, out.guarded = true, out.depth = drawn.depth;
  out.column_begin = HWY_MAX(drawn.column_begin - rect.x0, 0);
  out.column_end = HWY_MIN(drawn.column_end, rect.x1) - rect.x0;
  out.row_begin = HWY_MAX(drawn.row_begin - rect.y0, 0);
  out.row_end = HWY_MIN(drawn.row_end, rect.y1) - rect.y0;
  const std::int32_t dx = rect.x0 - drawn.column_begin, dy = rect.y0 - drawn.row_begin;
  for (int k = 0; k < 3; ++k) {
    out.edge[k] = drawn.edge[k] + drawn.step_x[k] * dx + drawn.step_y[k] * dy;
    out.step_x[k] = drawn.step_x[k], out.step_y[k] = drawn.step_y[k];
  }
  return out;
}

void DrawFaces(const ScreenMesh& mesh, const TileDrawList& list, const TileRect& rect,
               VisibilityTile* out) {
  float floor = 0;
  for (const std::int32_t index : list.indices) {
    const DrawnFace& drawn = list.faces[static_cast<std::size_t>(index)];
    if (drawn.depth.high <= floor) continue;
    if (drawn.small != 0) {
      DrawFace(mesh, InTile(drawn, rect), rect, &floor, out);
      continue;
    }
    TileFaceSetup face;
    if (SetUpTileFace(mesh, drawn.face, rect, &face)) DrawFace(mesh, face, rect, &floor, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of visibility.h. Lanes are the pixels of a row; a face walks only the columns and
// rows of its own box.
#if defined(TILEGRAD_RASTER_VISIBILITY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_VISIBILITY_INL_H_
#undef TILEGRAD_RASTER_VISIBILITY_INL_H_
#else
#define TILEGRAD_RASTER_VISIBILITY_INL_H_
#endif

#include <hwy/cache_control.h>
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

// Rows of a face's edge functions, one vector wide: at its first row, and from row to row.
template <class DI>
struct EdgeRows {
  hn::Vec<DI> edge[3], step[3];

  HWY_INLINE hn::Mask<DI> Inside(DI di) const {
    return hn::Gt(hn::Or(hn::Or(edge[0], edge[1]), edge[2]), hn::Set(di, -1));
  }
  HWY_INLINE void Step() {
    for (int k = 0; k < 3; ++k) edge[k] = hn::Add(edge[k], step[k]);
  }
};

// `edge` at pixel (0, 0) of `from`, and pixels (column, row) onwards wanted.
template <class DI, class Face>
HWY_INLINE EdgeRows<DI> RowsFrom(DI di, const Face& from, int column, int row) {
  const auto columns = hn::Add(hn::Iota(di, 0), hn::Set(di, column)), rows = hn::Set(di, row);
  EdgeRows<DI> out;
  for (int k = 0; k < 3; ++k) {
    out.step[k] = hn::Set(di, from.step_y[k]);
    const auto across = hn::Mul(hn::Set(di, from.step_x[k]), columns);
    out.edge[k] = hn::Add(hn::Add(hn::Set(di, from.edge[k]), across), hn::Mul(out.step[k], rows));
  }
  return out;
}

// Rows [begin, end) of the tile, one vector of columns from `column` on.
struct TileRows {
  int column, begin, end;
};

// Mul and Add are kept apart (no fused MulAdd): the same bits on every instruction set.
template <class D, class Rows>
HWY_INLINE void DrawRows(D d, Rows edges, const DepthPlane<float>& plane, std::int32_t face,
                         const TileRows& rows, const TileRect& rect, VisibilityTile* out) {
  const hn::RebindToSigned<D> di;
  const auto half = hn::Set(d, 0.5f);
  const auto column = hn::Add(hn::Iota(di, 0), hn::Set(di, rect.x0 + rows.column));
  const auto px = hn::Add(hn::ConvertTo(d, column), half);
  const auto dx = hn::Mul(hn::Set(d, plane.gx), hn::Sub(px, hn::Set(d, plane.x0)));
  const auto y0 = hn::Set(d, plane.y0), gy = hn::Set(d, plane.gy), base = hn::Set(d, plane.base);
  const auto low = hn::Set(d, plane.low), high = hn::Set(d, plane.high);
  const auto id = hn::Set(di, face);
  auto py = hn::Set(d, static_cast<float>(rect.y0 + rows.begin) + 0.5f);
  for (int i = rows.begin; i < rows.end; ++i) {
    const auto inside = edges.Inside(di);
    edges.Step();
    const auto dy = hn::Mul(gy, hn::Sub(py, y0));
    py = hn::Add(py, hn::Set(d, 1.0f));
    const auto z = hn::Min(hn::Max(hn::Add(base, hn::Add(dx, dy)), low), high);
    float* nearest = out->inverse_depth + i * kTileSize + rows.column;
    std::int32_t* ids = out->face + i * kTileSize + rows.column;
    const auto old = hn::LoadU(d, nearest);
    const auto seen = hn::And(hn::RebindMask(d, inside), hn::Gt(z, old));
    hn::StoreU(hn::IfThenElse(seen, z, old), d, nearest);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, seen), id, hn::LoadU(di, ids)), di, ids);
  }
}

// A face's box within a tile: columns [x0, x1), rows [y0, y1).
HWY_INLINE TileRect BoxInTile(const DrawnFace& face, const TileRect& rect) {
  return {HWY_MAX(face.column_begin - rect.x0, 0), HWY_MAX(face.row_begin - rect.y0, 0),
          HWY_MIN(face.column_end, rect.x1) - rect.x0, HWY_MIN(face.row_end, rect.y1) - rect.y0};
}

// A box up to kStamp wide and high is drawn as one square of that size, without a branch: what lies
// outside the box is not covered.
inline constexpr int kStamp = 4;

HWY_INLINE void DrawStamp(const DrawnFace& face, const TileRect& box, const TileRect& rect,
                          VisibilityTile* out) {
  const hn::FixedTag<float, kStamp> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int column = HWY_MIN(box.x0, kTileSize - kStamp), row = HWY_MIN(box.y0, kTileSize - kStamp);
  const auto edges =
      RowsFrom(di, face, rect.x0 + column - face.column_begin, rect.y0 + row - face.row_begin);
  DrawRows(d, edges, face.depth, face.face, {column, row, row + kStamp}, rect, out);
}

// No overflow in the edge functions: they are below 2^21 in a small face's box, and steps are up to
// 2^15.
HWY_INLINE void DrawSmall(const DrawnFace& face, const TileRect& rect, VisibilityTile* out) {
  const VisibilityTag d;
  const VisibilityIntTag di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const TileRect box = BoxInTile(face, rect);
  if (box.x1 - box.x0 <= kStamp && box.y1 - box.y0 <= kStamp) {
    DrawStamp(face, box, rect, out);
    return;
  }
  for (int at = HWY_MIN(box.x0, kTileSize - lanes); at < box.x1; at += lanes) {
    const int column = HWY_MIN(at, kTileSize - lanes);
    const auto edges =
        RowsFrom(di, face, rect.x0 + column - face.column_begin, rect.y0 + box.y0 - face.row_begin);
    DrawRows(d, edges, face.depth, face.face, {column, box.y0, box.y1}, rect, out);
  }
}

HWY_INLINE void DrawLarge(const ScreenMesh& mesh, const TileFaceSetup& face, const TileRect& rect,
                          VisibilityTile* out) {
  const VisibilityTag d;
  const VisibilityIntTag di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  if (!face.guarded) {
    DrawUnguarded(mesh, face, rect, out);
    return;
  }
  for (int at = HWY_MIN(face.column_begin, kTileSize - lanes); at < face.column_end; at += lanes) {
    const int column = HWY_MIN(at, kTileSize - lanes);
    DrawRows(d, RowsFrom(di, face, column, face.row_begin), face.depth, face.face,
             {column, face.row_begin, face.row_end}, rect, out);
  }
}

// `floor`: every pixel of the tile is at least this near. A face that covers the whole tile raises
// it; what lies behind is rejected unseen.
void DrawFaces(const ScreenMesh& mesh, const TileDrawList& list, const TileRect& rect,
               VisibilityTile* out) {
  constexpr std::size_t kAhead = 4;  // records lie in the order of the mesh, not of the tile
  float floor = 0;
  for (std::size_t i = 0; i < list.indices.size(); ++i) {
    const auto record = [&](std::size_t at) -> const DrawnFace& {
      return list.faces[static_cast<std::size_t>(list.indices[at])];
    };
    const DrawnFace& ahead = record(HWY_MIN(i + kAhead, list.indices.size() - 1));
    hwy::Prefetch(&ahead), hwy::Prefetch(&ahead.depth.high);
    const DrawnFace& drawn = record(i);
    if (drawn.depth.high <= floor) continue;
    if (drawn.small != 0) {
      DrawSmall(drawn, rect, out);
      continue;
    }
    TileFaceSetup face;
    if (!SetUpTileFace(mesh, drawn.face, rect, &face)) continue;
    DrawLarge(mesh, face, rect, out);
    if (face.guarded && face.CoversTile()) floor = HWY_MAX(floor, drawn.depth.low);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

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

// How the pixels of a bin lie in a vector: one row of them, as many as D has lanes.
template <class D>
struct OneRow {
  using Tag = D;
  using IntTag = hn::RebindToSigned<D>;
  static constexpr int kRows = 1;

  HWY_INLINE static hn::Vec<IntTag> Columns() { return hn::Iota(IntTag(), 0); }
  HWY_INLINE static hn::Vec<IntTag> Rows() { return hn::Zero(IntTag()); }
  template <class T>
  HWY_INLINE static auto Load(const T* from) {
    return hn::LoadU(hn::Rebind<T, D>(), from);
  }
  template <class T, class V>
  HWY_INLINE static void Store(V v, T* to) {
    hn::StoreU(v, hn::Rebind<T, D>(), to);
  }
};

// A box up to kStamp wide and high is drawn as one square of that size, without a branch: what lies
// outside the box is not covered.
inline constexpr int kStamp = 4;

#if HWY_MAX_BYTES >= 32 && !HWY_HAVE_SCALABLE
// Two rows of kStamp pixels.
struct TwoRows {
  using Tag = hn::FixedTag<float, 2 * kStamp>;
  using IntTag = hn::RebindToSigned<Tag>;
  static constexpr int kRows = 2;

  HWY_INLINE static hn::Vec<IntTag> Columns() {
    alignas(32) static constexpr std::int32_t kColumns[] = {0, 1, 2, 3, 0, 1, 2, 3};
    return hn::Load(IntTag(), kColumns);
  }
  HWY_INLINE static hn::Vec<IntTag> Rows() {
    alignas(32) static constexpr std::int32_t kRowOf[] = {0, 0, 0, 0, 1, 1, 1, 1};
    return hn::Load(IntTag(), kRowOf);
  }
  template <class T>
  HWY_INLINE static auto Load(const T* from) {
    const hn::FixedTag<T, kStamp> d;
    const hn::FixedTag<T, 2 * kStamp> both;
    return hn::Combine(both, hn::LoadU(d, from + kBinSize), hn::LoadU(d, from));
  }
  template <class T, class V>
  HWY_INLINE static void Store(V v, T* to) {
    const hn::FixedTag<T, kStamp> d;
    hn::StoreU(hn::LowerHalf(d, v), d, to), hn::StoreU(hn::UpperHalf(d, v), d, to + kBinSize);
  }
};
using StampLayout = TwoRows;
#else
using StampLayout = OneRow<hn::FixedTag<float, kStamp>>;
#endif

// What is drawn of a face: rows [begin, end), one vector of columns from `column` on. Counted from
// pixel (x0, y0), where the arrays begin.
struct DrawnRows {
  int column, begin, end;
  int x0, y0;
  std::int32_t* face;
  float* inverse_depth;
  const float* behind;  // of kPeel
};

// Which of the faces that cover a pixel count: all, or those behind a depth that each pixel has.
enum class Layer { kFirst, kPeel };

// Where a bin is drawn: the arrays of a VisibilityBin, and of kPeel what the pixels lie behind.
struct BinTarget {
  std::int32_t* face;
  float* inverse_depth;
  const float* behind;
};

// Where the edge functions are known: in a record of `Face`, at a pixel (column, row) before.
template <class Face>
struct EdgesAt {
  const Face& from;
  int columns, rows;  // from that pixel to the first that is drawn
};

// Mul and Add are kept apart (no fused MulAdd): the same bits on every instruction set.
template <Layer kLayer, class Layout, class Face>
HWY_INLINE void DrawRows(const EdgesAt<Face>& edges, const DrawnFace& face, const DrawnRows& rows) {
  const typename Layout::Tag d;
  const typename Layout::IntTag di;
  const auto columns = Layout::Columns(), inner_rows = Layout::Rows();
  hn::Vec<typename Layout::IntTag> edge[3], step[3];
  for (int k = 0; k < 3; ++k) {
    const auto across = hn::Set(di, edges.from.step_x[k]), down = hn::Set(di, edges.from.step_y[k]);
    const auto x = hn::Add(columns, hn::Set(di, edges.columns));
    const auto y = hn::Add(inner_rows, hn::Set(di, edges.rows));
    edge[k] =
        hn::Add(hn::Set(di, edges.from.edge[k]), hn::Add(hn::Mul(across, x), hn::Mul(down, y)));
    step[k] = Layout::kRows == 1 ? down : hn::Add(down, down);
  }
  const DepthPlane<float>& plane = face.depth;
  const auto half = hn::Set(d, 0.5f), next = hn::Set(d, static_cast<float>(Layout::kRows));
  const auto centre = [&](hn::Vec<typename Layout::IntTag> inner, int first) HWY_ATTR {
    return hn::Add(hn::ConvertTo(d, hn::Add(inner, hn::Set(di, first))), half);
  };
  const auto px = centre(columns, rows.x0 + rows.column);
  auto py = centre(inner_rows, rows.y0 + rows.begin);
  const auto dx = hn::Mul(hn::Set(d, plane.gx), hn::Sub(px, hn::Set(d, plane.x0)));
  const auto y0 = hn::Set(d, plane.y0), gy = hn::Set(d, plane.gy), base = hn::Set(d, plane.base);
  const auto low = hn::Set(d, plane.low), high = hn::Set(d, plane.high);
  const auto id = hn::Set(di, face.face);
  for (int i = rows.begin; i < rows.end; i += Layout::kRows) {
    const auto inside = hn::Gt(hn::Or(hn::Or(edge[0], edge[1]), edge[2]), hn::Set(di, -1));
    for (int k = 0; k < 3; ++k) edge[k] = hn::Add(edge[k], step[k]);
    const auto dy = hn::Mul(gy, hn::Sub(py, y0));
    py = hn::Add(py, next);
    const auto z = hn::Min(hn::Max(hn::Add(base, hn::Add(dx, dy)), low), high);
    float* nearest = rows.inverse_depth + i * kBinSize + rows.column;
    std::int32_t* ids = rows.face + i * kBinSize + rows.column;
    const auto old = Layout::Load(nearest);
    auto seen = hn::And(hn::RebindMask(d, inside), hn::Gt(z, old));
    if constexpr (kLayer == Layer::kPeel) {
      const float* behind = rows.behind + i * kBinSize + rows.column;
      seen = hn::And(seen, hn::Lt(z, Layout::Load(behind)));
    }
    Layout::Store(hn::IfThenElse(seen, z, old), nearest);
    Layout::Store(hn::IfThenElse(hn::RebindMask(di, seen), id, Layout::Load(ids)), ids);
  }
}

// A face's box within a bin: columns [x0, x1), rows [y0, y1).
HWY_INLINE TileRect BoxIn(const TileRect& rect, const DrawnFace& face) {
  return {HWY_MAX(face.column_begin - rect.x0, 0), HWY_MAX(face.row_begin - rect.y0, 0),
          HWY_MIN(face.column_end, rect.x1) - rect.x0, HWY_MIN(face.row_end, rect.y1) - rect.y0};
}

template <Layer kLayer>
HWY_INLINE void DrawStamp(const DrawnFace& face, const TileRect& box, const TileRect& rect,
                          const BinTarget& out) {
  const int column = HWY_MIN(box.x0, kBinSize - kStamp), row = HWY_MIN(box.y0, kBinSize - kStamp);
  DrawRows<kLayer, StampLayout>(
      EdgesAt<DrawnFace>{face, rect.x0 + column - face.column_begin,
                         rect.y0 + row - face.row_begin},
      face, {column, row, row + kStamp, rect.x0, rect.y0, out.face, out.inverse_depth, out.behind});
}

// No overflow in the edge functions: they are below 2^21 in a small face's box, and steps are up to
// 2^15.
template <Layer kLayer>
HWY_INLINE void DrawSmall(const DrawnFace& face, const TileRect& rect, const BinTarget& out) {
  const int lanes = static_cast<int>(hn::Lanes(VisibilityTag()));
  const TileRect box = BoxIn(rect, face);
  if (box.x1 - box.x0 <= kStamp && box.y1 - box.y0 <= kStamp) {
    DrawStamp<kLayer>(face, box, rect, out);
    return;
  }
  for (int at = HWY_MIN(box.x0, kBinSize - lanes); at < box.x1; at += lanes) {
    const int column = HWY_MIN(at, kBinSize - lanes);
    DrawRows<kLayer, OneRow<VisibilityTag>>(
        EdgesAt<DrawnFace>{face, rect.x0 + column - face.column_begin,
                           rect.y0 + box.y0 - face.row_begin},
        face, {column, box.y0, box.y1, rect.x0, rect.y0, out.face, out.inverse_depth, out.behind});
  }
}

// The slow way, in 128 bits, for faces that leave the guard band.
template <Layer kLayer>
HWY_INLINE void DrawUnguarded(const SnappedFace& shape, const DrawnFace& face,
                              const TileFaceSetup& tile, const DrawnRows& at) {
  for (int i = tile.row_begin; i < tile.row_end; ++i) {
    for (int j = tile.column_begin; j < tile.column_end; ++j) {
      const int column = at.x0 + j, row = at.y0 + i, pixel = i * kBinSize + j;
      if (!Covers(shape, column, row)) continue;
      const float z =
          face.depth.At(static_cast<float>(column) + 0.5f, static_cast<float>(row) + 0.5f);
      if (!(z > at.inverse_depth[pixel])) continue;
      if (kLayer == Layer::kPeel && !(z < at.behind[pixel])) continue;
      at.inverse_depth[pixel] = z, at.face[pixel] = face.face;
    }
  }
}

// A large face in one tile of a bin, whose arrays `rows` begins. Returns whether it covers all of
// it.
template <Layer kLayer>
HWY_INLINE bool DrawTile(const SnappedFace& shape, const DrawnFace& face, const TileRect& tile,
                         DrawnRows rows) {
  TileFaceSetup setup;
  if (!SetUpTileFace(shape, tile, &setup)) return false;
  if (!setup.guarded) {
    DrawUnguarded<kLayer>(shape, face, setup, rows);
    return false;
  }
  const int lanes = static_cast<int>(hn::Lanes(VisibilityTag()));
  rows.begin = setup.row_begin, rows.end = setup.row_end;
  for (int at = HWY_MIN(setup.column_begin, kTileSize - lanes); at < setup.column_end;
       at += lanes) {
    rows.column = HWY_MIN(at, kTileSize - lanes);
    DrawRows<kLayer, OneRow<VisibilityTag>>(EdgesAt<TileFaceSetup>{setup, rows.column, rows.begin},
                                            face, rows);
  }
  return setup.CoversTile();
}

// How near every pixel of a tile is at least. A large face that covers the tile raises it; what
// lies behind is rejected unseen.
struct DepthFloors {
  float tile[kBinSize / kTileSize][kBinSize / kTileSize] = {};
  float bin = 0;  // the least

  HWY_INLINE void Update() {
    bin = tile[0][0];
    for (const auto& row : tile) {
      for (const float floor : row) bin = HWY_MIN(bin, floor);
    }
  }
};

// Large faces go tile by tile: their exact edge functions step through a tile in 32 bits.
template <Layer kLayer>
HWY_INLINE void DrawLarge(const ScreenMesh& mesh, const DrawnFace& face, const TileRect& rect,
                          DepthFloors* floors, const BinTarget& out) {
  const SnappedFace shape = SnapFaceClockwise(mesh, static_cast<std::size_t>(face.face));
  const TileRect box = BoxIn(rect, face);
  for (int y = box.y0 >> kTileBits; y << kTileBits < box.y1; ++y) {
    for (int x = box.x0 >> kTileBits; x << kTileBits < box.x1; ++x) {
      float& floor = floors->tile[y][x];
      if (face.depth.high <= floor) continue;
      const int x0 = rect.x0 + (x << kTileBits), y0 = rect.y0 + (y << kTileBits);
      const TileRect tile{x0, y0, HWY_MIN(x0 + kTileSize, rect.x1),
                          HWY_MIN(y0 + kTileSize, rect.y1)};
      const int first = ((y << kTileBits) << kBinBits) + (x << kTileBits);
      // Of a layer that is peeled, a face that covers a tile may lie before what is asked for.
      const bool covered = DrawTile<kLayer>(
          shape, face, tile,
          {0, 0, 0, x0, y0, out.face + first, out.inverse_depth + first, out.behind + first});
      if (covered && kLayer == Layer::kFirst) floor = HWY_MAX(floor, face.depth.low);
    }
  }
  floors->Update();
}

template <Layer kLayer>
HWY_INLINE void DrawLayer(const ScreenMesh& mesh, const BinDrawList& list, const TileRect& rect,
                          const BinTarget& out) {
  constexpr std::size_t kAhead = 4;  // records lie in the order of the mesh, not of the bin
  DepthFloors floors;
  for (std::size_t i = 0; i < list.indices.size(); ++i) {
    const auto record = [&](std::size_t at) -> const DrawnFace& {
      return list.faces[static_cast<std::size_t>(list.indices[at])];
    };
    const DrawnFace& ahead = record(HWY_MIN(i + kAhead, list.indices.size() - 1));
    hwy::Prefetch(&ahead), hwy::Prefetch(&ahead.depth.high);
    const DrawnFace& face = record(i);
    if (face.depth.high <= floors.bin) continue;
    if (face.small != 0) {
      DrawSmall<kLayer>(face, rect, out);
    } else {
      DrawLarge<kLayer>(mesh, face, rect, &floors, out);
    }
  }
}

// `behind` null: Layer::kFirst.
void DrawFaces(const ScreenMesh& mesh, const BinDrawList& list, const TileRect& rect,
               const float* behind, VisibilityBin* out) {
  const BinTarget target{out->face, out->inverse_depth, behind};
  if (behind == nullptr) {
    DrawLayer<Layer::kFirst>(mesh, list, rect, target);
  } else {
    DrawLayer<Layer::kPeel>(mesh, list, rect, target);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

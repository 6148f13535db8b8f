// SPDX-License-Identifier: Apache-2.0
// Vector body of visibility.h. Lanes are the pixels of a row; a face walks only the columns and
// rows of its own box.
#if defined(TILEGRAD_RASTER_VISIBILITY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_VISIBILITY_INL_H_
#undef TILEGRAD_RASTER_VISIBILITY_INL_H_
#else
#define TILEGRAD_RASTER_VISIBILITY_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "base/prefetch.h"
#include "raster/visibility.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using VisibilityTag = HWY_CAPPED(float, kTileSize);

// Layout of a bin's pixels in a vector: one row, with as many pixels as D has lanes.
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
    hn::StoreU(hn::LowerHalf(d, v), d, to);
    hn::StoreU(hn::UpperHalf(d, v), d, to + kBinSize);
  }
};
using StampLayout = TwoRows;
#else
using StampLayout = OneRow<hn::FixedTag<float, kStamp>>;
#endif

// The drawn part of a face: rows [begin, end), one vector of columns from `column` on. Relative to
// pixel (x0, y0), where the arrays begin.
struct DrawnRows {
  int column, begin, end;
  int x0, y0;
  std::int32_t* face;
  float* inverse_depth;
  const float* behind;  // of kPeel
};

// Which of the faces covering a pixel count: all, or only those behind a per-pixel depth.
enum class Layer { kFirst, kPeel };

// The target of drawing a bin: the arrays of a VisibilityBin, and for kPeel the depths to lie
// behind.
struct BinTarget {
  std::int32_t* face;
  float* inverse_depth;
  const float* behind;
};

// Where the edge functions are known: in a record of `Face`, at an earlier pixel (column, row).
template <class Face>
struct EdgesAt {
  const Face& from;
  int columns, rows;  // from that pixel to the first drawn one
};

// 1/depth of a face at the rows of a vector of columns. Mul and Add are kept apart (no fused
// MulAdd): the same bits on every instruction set.
template <class Layout>
class DepthRows {
 public:
  using Tag = typename Layout::Tag;
  using V = hn::Vec<Tag>;

  // From pixel (column, row) of the image on.
  HWY_INLINE DepthRows(const DepthPlane<float>& plane, int column, int row)
      : py_(Centre(Layout::Rows(), row)),
        y0_(hn::Set(Tag(), plane.y0)),
        gy_(hn::Set(Tag(), plane.gy)),
        base_(hn::Set(Tag(), plane.base)),
        low_(hn::Set(Tag(), plane.low)),
        high_(hn::Set(Tag(), plane.high)) {
    const V px = Centre(Layout::Columns(), column);
    dx_ = hn::Mul(hn::Set(Tag(), plane.gx), hn::Sub(px, hn::Set(Tag(), plane.x0)));
  }
  // At the next Layout::kRows rows.
  HWY_INLINE V Next() {
    const V dy = hn::Mul(gy_, hn::Sub(py_, y0_));
    py_ = hn::Add(py_, hn::Set(Tag(), static_cast<float>(Layout::kRows)));
    return hn::Min(hn::Max(hn::Add(base_, hn::Add(dx_, dy)), low_), high_);
  }

 private:
  HWY_INLINE static V Centre(hn::Vec<typename Layout::IntTag> inner, int first) {
    const typename Layout::IntTag di;
    return hn::Add(hn::ConvertTo(Tag(), hn::Add(inner, hn::Set(di, first))), hn::Set(Tag(), 0.5f));
  }

  V dx_, py_, y0_, gy_, base_, low_, high_;
};

// Draws `face` where it is `inside` and nearer than the current face: a vector at row i of `rows`.
template <Layer kLayer, class Layout, class Inside>
HWY_INLINE void DrawNearer(const DrawnRows& rows, int i, Inside inside,
                           hn::Vec<typename Layout::IntTag> face, hn::Vec<typename Layout::Tag> z) {
  const typename Layout::Tag d;
  const typename Layout::IntTag di;
  float* nearest = rows.inverse_depth + i * kBinSize + rows.column;
  std::int32_t* ids = rows.face + i * kBinSize + rows.column;
  const auto old = Layout::Load(nearest);
  auto seen = hn::And(hn::RebindMask(d, inside), hn::Gt(z, old));
  if constexpr (kLayer == Layer::kPeel) {
    const float* behind = rows.behind + i * kBinSize + rows.column;
    seen = hn::And(seen, hn::Lt(z, Layout::Load(behind)));
  }
  Layout::Store(hn::IfThenElse(seen, z, old), nearest);
  Layout::Store(hn::IfThenElse(hn::RebindMask(di, seen), face, Layout::Load(ids)), ids);
}

template <Layer kLayer, class Layout, class Face>
HWY_INLINE void DrawRows(const EdgesAt<Face>& edges, const DrawnFace& face, const DrawnRows& rows) {
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
  DepthRows<Layout> depth(face.depth, rows.x0 + rows.column, rows.y0 + rows.begin);
  const auto id = hn::Set(di, face.face);
  for (int i = rows.begin; i < rows.end; i += Layout::kRows) {
    const auto inside = hn::Gt(hn::Or(hn::Or(edge[0], edge[1]), edge[2]), hn::Set(di, -1));
    for (int k = 0; k < 3; ++k) edge[k] = hn::Add(edge[k], step[k]);
    DrawNearer<kLayer, Layout>(rows, i, inside, id, depth.Next());
  }
}

// A face's box within a bin: columns [x0, x1), rows [y0, y1).
HWY_INLINE PixelRect BoxIn(const PixelRect& rect, const DrawnFace& face) {
  return {HWY_MAX(face.column_begin - rect.x0, 0), HWY_MAX(face.row_begin - rect.y0, 0),
          HWY_MIN(face.column_end, rect.x1) - rect.x0, HWY_MIN(face.row_end, rect.y1) - rect.y0};
}

// A stamp moved right and down by this many columns and rows, each less than kStamp; pixels that
// leave it are lost.
HWY_INLINE std::int32_t MovedStamp(std::int32_t pixels, int columns, int rows) {
  constexpr std::int32_t kRow = (1 << kStamp) - 1, kAll = (1 << kStamp * kStamp) - 1;
  constexpr std::int32_t kEachRow = kAll / kRow;
  pixels = columns >= 0 ? pixels << columns & kEachRow * (kRow << columns & kRow)
                        : pixels >> -columns & kEachRow * (kRow >> -columns);
  return rows >= 0 ? pixels << kStamp * rows & kAll : pixels >> -kStamp * rows;
}

// A face with known covered pixels. No branch on their position: the stamp lies wholly within the
// bin.
template <Layer kLayer>
HWY_INLINE void DrawStamp(const DrawnFace& face, const PixelRect& rect, const BinTarget& out) {
  using Layout = StampLayout;
  const Layout::IntTag di;
  const int x = face.column_begin - rect.x0, y = face.row_begin - rect.y0;
  const int column = HWY_MAX(0, HWY_MIN(x, kBinSize - kStamp));
  const int row = HWY_MAX(0, HWY_MIN(y, kBinSize - kStamp));
  std::int32_t pixels = face.pixels;
  if (HWY_UNLIKELY(column != x || row != y)) pixels = MovedStamp(pixels, x - column, y - row);
  const DrawnRows rows{column,  row,      row + kStamp,      rect.x0,
                       rect.y0, out.face, out.inverse_depth, out.behind};
  DepthRows<Layout> depth(face.depth, rect.x0 + column, rect.y0 + row);
  const auto id = hn::Set(di, face.face);
  const auto bits = hn::Shl(
      hn::Set(di, 1), hn::Add(Layout::Columns(), hn::Mul(hn::Set(di, kStamp), Layout::Rows())));
  for (int i = 0; i < kStamp; i += Layout::kRows) {
    const auto inside = hn::Eq(hn::And(hn::Set(di, pixels >> kStamp * i), bits), bits);
    DrawNearer<kLayer, Layout>(rows, row + i, inside, id, depth.Next());
  }
}

// Draws in rows of D's lanes. If a face fits between two multiples of the lane count, vectors are
// aligned to it: store forwarding then works, and no vector straddles a cache line.
template <Layer kLayer, class D>
HWY_INLINE void DrawInRows(D d, const DrawnFace& face, const PixelRect& rect, const PixelRect& box,
                           const BinTarget& out) {
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int aligned = box.x0 & -lanes;
  const int first = box.x1 <= aligned + lanes ? aligned : HWY_MIN(box.x0, kBinSize - lanes);
  for (int at = first; at < box.x1; at += lanes) {
    const int column = HWY_MIN(at, kBinSize - lanes);
    DrawRows<kLayer, OneRow<D>>(
        EdgesAt<DrawnFace>{face, rect.x0 + column - face.column_begin,
                           rect.y0 + box.y0 - face.row_begin},
        face, {column, box.y0, box.y1, rect.x0, rect.y0, out.face, out.inverse_depth, out.behind});
  }
}

// Edge functions cannot overflow: they are below 2^21 in a small face's box, steps are up to 2^15,
// and vectors begin less than kTileSize columns before it. A narrow face takes few lanes: on Zen 4
// a store of 64 bytes takes twice as long as one of 32.
template <Layer kLayer>
HWY_INLINE void DrawSmall(const DrawnFace& face, const PixelRect& rect, const BinTarget& out) {
  constexpr int kNarrow = 8;
  const PixelRect box = BoxIn(rect, face);
  if (hn::MaxLanes(VisibilityTag()) > kNarrow && box.x1 - box.x0 <= kNarrow) {
    DrawInRows<kLayer>(HWY_CAPPED(float, kNarrow)(), face, rect, box, out);
  } else {
    DrawInRows<kLayer>(VisibilityTag(), face, rect, box, out);
  }
}

// The slow path, in 128 bits, for faces that leave the guard band.
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
      at.inverse_depth[pixel] = z;
      at.face[pixel] = face.face;
    }
  }
}

// Draws a large face in one tile of a bin, at which the arrays of `rows` begin. Returns whether it
// covers the whole tile.
template <Layer kLayer>
HWY_INLINE bool DrawTile(const SnappedFace& shape, const DrawnFace& face, const PixelRect& tile,
                         DrawnRows rows) {
  TileFaceSetup setup;
  if (!SetUpTileFace(shape, tile, &setup)) return false;
  if (!setup.guarded) {
    DrawUnguarded<kLayer>(shape, face, setup, rows);
    return false;
  }
  const int lanes = static_cast<int>(hn::Lanes(VisibilityTag()));
  rows.begin = setup.row_begin;
  rows.end = setup.row_end;
  for (int at = HWY_MIN(setup.column_begin, kTileSize - lanes); at < setup.column_end;
       at += lanes) {
    rows.column = HWY_MIN(at, kTileSize - lanes);
    DrawRows<kLayer, OneRow<VisibilityTag>>(EdgesAt<TileFaceSetup>{setup, rows.column, rows.begin},
                                            face, rows);
  }
  return setup.CoversTile();
}

// A depth bound per tile: every pixel is at least this near. A large face that covers the tile
// raises it; faces behind it are rejected without visiting pixels.
struct DepthFloors {
  float tile[kBinSize / kTileSize][kBinSize / kTileSize] = {};
  float bin = 0;  // the minimum over its tiles

  HWY_INLINE void Update() {
    bin = tile[0][0];
    for (const auto& row : tile) {
      for (const float floor : row) bin = HWY_MIN(bin, floor);
    }
  }
};

// Draws large faces tile by tile: their exact edge functions step through a tile in 32 bits.
template <Layer kLayer>
HWY_INLINE void DrawLarge(const ScreenMesh& mesh, const DrawnFace& face, const PixelRect& rect,
                          DepthFloors* floors, const BinTarget& out) {
  const SnappedFace shape = SnapFaceClockwise(mesh, static_cast<std::size_t>(face.face));
  const PixelRect box = BoxIn(rect, face);
  for (int y = box.y0 >> kTileBits; y << kTileBits < box.y1; ++y) {
    for (int x = box.x0 >> kTileBits; x << kTileBits < box.x1; ++x) {
      float& floor = floors->tile[y][x];
      if (face.depth.high <= floor) continue;
      const int x0 = rect.x0 + (x << kTileBits), y0 = rect.y0 + (y << kTileBits);
      const PixelRect tile{x0, y0, HWY_MIN(x0 + kTileSize, rect.x1),
                           HWY_MIN(y0 + kTileSize, rect.y1)};
      const int first = ((y << kTileBits) << kBinBits) + (x << kTileBits);
      const float* behind = kLayer == Layer::kPeel ? out.behind + first : nullptr;
      // When peeling, a face that covers a tile may lie in front of the drawn layer.
      const bool covered =
          DrawTile<kLayer>(shape, face, tile,
                           {0, 0, 0, x0, y0, out.face + first, out.inverse_depth + first, behind});
      if (covered && kLayer == Layer::kFirst) floor = HWY_MAX(floor, face.depth.low);
    }
  }
  floors->Update();
}

template <Layer kLayer>
HWY_INLINE void DrawLayer(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                          const BinTarget& out) {
  constexpr std::size_t kAhead = 4;  // records are in mesh order, not bin order
  DepthFloors floors;
  for (std::size_t i = 0; i < list.indices.size(); ++i) {
    const auto record = [&](std::size_t at) -> const DrawnFace& {
      return list.faces[static_cast<std::size_t>(list.indices[at])];
    };
    const DrawnFace& ahead = record(HWY_MIN(i + kAhead, list.indices.size() - 1));
    PrefetchLine(&ahead);
    PrefetchLine(&ahead.depth.high);
    const DrawnFace& face = record(i);
    if (face.depth.high <= floors.bin) continue;
    if (face.pixels > 0) {
      DrawStamp<kLayer>(face, rect, out);
    } else if (face.pixels == DrawnFace::kByEdges) {
      DrawSmall<kLayer>(face, rect, out);
    } else {
      DrawLarge<kLayer>(mesh, face, rect, &floors, out);
    }
  }
}

// `behind` null: Layer::kFirst.
void DrawFaces(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
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

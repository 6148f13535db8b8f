// SPDX-License-Identifier: Apache-2.0
// Vector body of drawn_faces.h; lanes are faces. Bitwise equal to the scalar code of coverage.h and
// face_plane.h (no fused operations).
#if defined(TILEGRAD_RASTER_DRAWN_FACES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_DRAWN_FACES_INL_H_
#undef TILEGRAD_RASTER_DRAWN_FACES_INL_H_
#else
#define TILEGRAD_RASTER_DRAWN_FACES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>

#include "base/simd_math-inl.h"
#include "raster/coverage.h"
#include "raster/drawn_faces.h"
#include "raster/face_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace simd = tilegrad::HWY_NAMESPACE;

struct ShapeCorners {
  FaceVec x[3], y[3], z[3];
};

// Faces f to f + count - 1; lanes beyond repeat the first.
HWY_INLINE ShapeCorners LoadShapeCorners(const ScreenMesh& mesh, std::size_t f, std::size_t count) {
  const std::int32_t* const corners[3] = {&mesh.v0[f], &mesh.v1[f], &mesh.v2[f]};
  ShapeCorners out;
  for (int k = 0; k < 3; ++k) {
    const std::int32_t* vertices = corners[k];
    HWY_ALIGN std::int32_t some[kMostFaceLanes];
    if (count < hn::Lanes(FaceTag())) {
      hn::Store(LoadSome(vertices, count), FaceIntTag(), some);
      vertices = some;
    }
    FaceVec v[4];
    LoadVertices(mesh, vertices, v);
    out.x[k] = v[0];
    out.y[k] = v[1];
    out.z[k] = v[2];
  }
  return out;
}

// Corners in subpixels. Coordinates beyond any image saturate.
struct SnappedLanes {
  FaceInt x[3], y[3];
};

HWY_INLINE FaceInt SnapLanes(FaceVec pixels) {
  const FaceTag d;
  const auto far = hn::Set(d, static_cast<float>(kFarSubpixels));
  const auto scaled = hn::Mul(pixels, hn::Set(d, static_cast<float>(kSubpixels)));
  return hn::NearestInt(hn::Min(hn::Max(scaled, hn::Neg(far)), far));
}

// The minimum and maximum of three along one axis.
struct RangeLanes {
  FaceInt low, high;
};
HWY_INLINE RangeLanes RangeOf(const FaceInt (&c)[3]) {
  return {hn::Min(hn::Min(c[0], c[1]), c[2]), hn::Max(hn::Max(c[0], c[1]), c[2])};
}

HWY_INLINE FaceIntMask IsSmall(const RangeLanes& range) {
  const FaceIntTag di;
  const auto far = hn::Set(di, kFarSubpixels);
  const auto within = hn::And(hn::Gt(range.low, hn::Neg(far)), hn::Lt(range.high, far));
  return hn::And(within, hn::Lt(hn::Sub(range.high, range.low), hn::Set(di, kSmallExtent + 1)));
}

// Pixels [begin, end) of the image along one axis with centres in the range.
struct PixelLanes {
  FaceInt begin, end;
};
HWY_INLINE PixelLanes PixelsOf(const RangeLanes& range, int size) {
  const FaceIntTag di;
  constexpr auto kHalf = static_cast<std::int32_t>(kSubpixels / 2);
  const auto clamp = [&](FaceInt v)
                         HWY_ATTR { return hn::Min(hn::Max(v, hn::Zero(di)), hn::Set(di, size)); };
  const auto first = hn::Add(range.low, hn::Set(di, kHalf - 1));
  const auto last = hn::Add(range.high, hn::Set(di, kHalf));
  return {clamp(hn::ShiftRight<kSubpixelBits>(first)), clamp(hn::ShiftRight<kSubpixelBits>(last))};
}

// Doubled area, positive if clockwise as seen.
HWY_INLINE FaceInt AreaLanes(const SnappedLanes& s) {
  return hn::Sub(hn::Mul(hn::Sub(s.x[1], s.x[0]), hn::Sub(s.y[2], s.y[0])),
                 hn::Mul(hn::Sub(s.x[2], s.x[0]), hn::Sub(s.y[1], s.y[0])));
}

// The records of a vector of faces, word by word: word w of every face.
inline constexpr int kWords = sizeof(DrawnFace) / 4, kDepthWord = 4, kEdgeWord = 11;
static_assert(offsetof(DrawnFace, edge) == 4 * kEdgeWord && offsetof(DrawnFace, pixels) == 4 &&
              offsetof(DrawnFace, column_begin) == 8 &&
              offsetof(DrawnFace, depth) == 4 * kDepthWord);
struct FaceWords {
  FaceInt word[kWords];
};

// Swaps corners 1 and 2 where the doubled area is negative.
HWY_INLINE void WindClockwise(FaceInt area, SnappedLanes* s) {
  const auto swap = hn::Lt(area, hn::Zero(FaceIntTag()));
  for (auto* a : {s->x, s->y}) {
    const auto first = a[1];
    a[1] = hn::IfThenElse(swap, a[2], first);
    a[2] = hn::IfThenElse(swap, first, a[2]);
  }
}

HWY_INLINE FaceInt FromCentre(FaceInt subpixels, FaceInt pixel) {
  const FaceIntTag di;
  const auto centre = hn::Add(hn::ShiftLeft<kSubpixelBits>(pixel),
                              hn::Set(di, static_cast<std::int32_t>(kSubpixels / 2)));
  return hn::Sub(subpixels, centre);
}

// Edge functions at the first pixel of the box, for corners wound clockwise.
HWY_INLINE void SetEdges(SnappedLanes s, FaceInt column, FaceInt row, FaceWords* out) {
  const FaceIntTag di;
  const auto zero = hn::Zero(di);
  for (auto& x : s.x) x = FromCentre(x, column);
  for (auto& y : s.y) y = FromCentre(y, row);
  for (int k = 0; k < 3; ++k) {
    const int n = k == 2 ? 0 : k + 1;
    const auto dx = hn::Sub(s.x[n], s.x[k]), dy = hn::Sub(s.y[n], s.y[k]);
    const auto left_or_top = hn::Or(hn::Lt(dy, zero), hn::And(hn::Eq(dy, zero), hn::Gt(dx, zero)));
    const auto at = hn::Sub(hn::Mul(dy, s.x[k]), hn::Mul(dx, s.y[k]));
    const auto exact = hn::Add(at, hn::IfThenZeroElse(left_or_top, hn::Set(di, -1)));
    out->word[kEdgeWord + k] = hn::ShiftRight<kSubpixelBits>(exact);
    out->word[kEdgeWord + 3 + k] = hn::Neg(dy);
    out->word[kEdgeWord + 6 + k] = dx;
  }
}

// SwapUnlessOrdered of face_plane.h.
HWY_INLINE void OrderLanes(ShapeCorners* c, int i, int j) {
  const auto ordered =
      hn::Or(hn::Lt(c->x[i], c->x[j]), hn::And(hn::Eq(c->x[i], c->x[j]), hn::Le(c->y[i], c->y[j])));
  for (auto* a : {c->x, c->y, c->z}) {
    const auto first = a[i];
    a[i] = hn::IfThenElse(ordered, first, a[j]);
    a[j] = hn::IfThenElse(ordered, a[j], first);
  }
}

// NarrowDepthPlane of face_plane.h, in the same order of operations.
HWY_INLINE void SetDepth(ShapeCorners c, FaceWords* out) {
  const FaceTag d;
  OrderLanes(&c, 0, 1);
  OrderLanes(&c, 1, 2);
  OrderLanes(&c, 0, 1);
  const auto x1 = hn::Sub(c.x[1], c.x[0]), y1 = hn::Sub(c.y[1], c.y[0]);
  const auto x2 = hn::Sub(c.x[2], c.x[0]), y2 = hn::Sub(c.y[2], c.y[0]);
  const auto x3 = hn::Sub(x2, x1), y3 = hn::Sub(y2, y1);
  const auto area = hn::Sub(hn::Mul(x1, y2), hn::Mul(x2, y1));
  const auto square = [&](FaceVec x, FaceVec y)
                          HWY_ATTR { return hn::Add(hn::Mul(x, x), hn::Mul(y, y)); };
  const auto longest = hn::Max(hn::Max(square(x1, y1), square(x2, y2)), square(x3, y3));
  constexpr auto kThin = static_cast<float>(kFlatHeight * kFlatHeight);
  const auto solid = hn::Gt(hn::Mul(area, area), hn::Mul(hn::Set(d, kThin), longest));
  const auto inverse = hn::IfThenElseZero(solid, hn::Div(hn::Set(d, 1.0f), area));
  const auto slope = [&](FaceVec g1, FaceVec g2) HWY_ATTR {
    const auto g0 = hn::Neg(hn::Add(g1, g2));
    const auto first = hn::Add(hn::Mul(g0, c.z[0]), hn::Mul(g1, c.z[1]));
    return hn::IfThenElseZero(solid, hn::Add(first, hn::Mul(g2, c.z[2])));
  };
  const auto third = hn::Set(d, 1.0f / 3.0f);
  const auto mean =
      hn::Add(hn::Add(hn::Mul(third, c.z[0]), hn::Mul(third, c.z[1])), hn::Mul(third, c.z[2]));
  const FaceVec plane[7] = {
      c.x[0],
      c.y[0],
      hn::IfThenElse(solid, c.z[0], mean),
      slope(hn::Mul(y2, inverse), hn::Mul(hn::Neg(y1), inverse)),
      slope(hn::Mul(hn::Neg(x2), inverse), hn::Mul(x1, inverse)),
      hn::Min(hn::Min(c.z[0], c.z[1]), c.z[2]),
      hn::Max(hn::Max(c.z[0], c.z[1]), c.z[2]),
  };
  for (int i = 0; i < 7; ++i) out->word[kDepthWord + i] = hn::BitCast(FaceIntTag(), plane[i]);
}

// Of four words.
inline constexpr int kPieces = kWords / 4;
inline constexpr int kPiecesWithoutEdges = (kEdgeWord + 3) / 4;

// BinRange as two words.
struct BinWords {
  FaceInt first, size;

  HWY_INLINE BinWords(const PixelLanes& columns, const PixelLanes& rows, int width) {
    const FaceIntTag di;
    const auto x = hn::ShiftRight<kBinBits>(columns.begin),
               y = hn::ShiftRight<kBinBits>(rows.begin);
    const auto behind = [&](FaceInt end) HWY_ATTR {
      return hn::ShiftRight<kBinBits>(hn::Add(end, hn::Set(di, kBinSize - 1)));
    };
    const int bin_columns = (width + kBinSize - 1) >> kBinBits;
    first = hn::Add(hn::Mul(y, hn::Set(di, bin_columns)), x);
    size = hn::Or(hn::Sub(behind(columns.end), x), hn::ShiftLeft<16>(hn::Sub(behind(rows.end), y)));
  }
};
static_assert(sizeof(BinRange) == 8 && offsetof(BinRange, columns) == 4);

HWY_INLINE void StoreBins(const BinWords& words, std::uint32_t keep, BinRange* out) {
  HWY_ALIGN std::int32_t lanes[2 * kMostFaceLanes];
  hn::StoreInterleaved2(words.first, words.size, FaceIntTag(), lanes);
  for (; keep != 0; keep &= keep - 1, ++out) {
    std::memcpy(out, lanes + 2 * hwy::Num0BitsBelowLS1Bit_Nonzero32(keep), sizeof(BinRange));
  }
}

// Writes the first pieces of the records of the lanes in `keep`. Returns the address of the next
// one.
template <int kCount>
HWY_INLINE DrawnFace* StoreRecords(const FaceWords& words, std::uint32_t keep, DrawnFace* out) {
  const FaceIntTag di;
  HWY_ALIGN std::int32_t piece[kCount][4 * kMostFaceLanes];
  for (int p = 0; p < kCount; ++p) {
    const FaceInt* w = words.word + 4 * p;
    hn::StoreInterleaved4(w[0], w[1], w[2], w[3], di, piece[p]);
  }
  for (; keep != 0; keep &= keep - 1, ++out) {
    const std::size_t lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(keep);
    auto* bytes = reinterpret_cast<char*>(out);
    for (int p = 0; p < kCount; ++p) std::memcpy(bytes + 16 * p, piece[p] + 4 * lane, 16);
  }
  return out;
}

// Shape tests of a vector of faces.
struct ShapeLanes {
  SnappedLanes corners;
  RangeLanes x, y;
  FaceInt area;  // where small
  FaceIntMask small;
};

HWY_INLINE ShapeLanes ShapesOf(const ShapeCorners& c) {
  ShapeLanes out;
  for (int k = 0; k < 3; ++k) {
    out.corners.x[k] = SnapLanes(c.x[k]);
    out.corners.y[k] = SnapLanes(c.y[k]);
  }
  out.x = RangeOf(out.corners.x);
  out.y = RangeOf(out.corners.y);
  out.small = hn::And(IsSmall(out.x), IsSmall(out.y));
  out.area = AreaLanes(out.corners);
  return out;
}

// Sets reject[0] to reject[count - 1], for faces from f on. Returns bits of the drawn ones.
HWY_INLINE std::uint32_t RejectShapes(const ScreenMesh& mesh, const ShapeLanes& shapes,
                                      bool cull_back, std::size_t f, std::size_t count,
                                      std::uint8_t* reject) {
  const FaceIntTag di;
  const std::uint32_t small = BitsOf(FaceIntTag(), shapes.small);
  const std::uint32_t flat = BitsOf(FaceIntTag(), hn::Eq(shapes.area, hn::Zero(di)));
  const std::uint32_t back =
      cull_back ? BitsOf(FaceIntTag(), hn::Gt(shapes.area, hn::Zero(di))) : 0;
  // Usually none of them is rejected.
  const std::uint32_t all = static_cast<std::uint32_t>((std::uint64_t{1} << count) - 1);
  std::uint8_t before = 0;
  for (std::size_t i = 0; i < count; ++i) before |= reject[i];
  if (before == 0 && ((flat | back | ~small) & all) == 0) return all;
  std::uint32_t drawn = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (reject[i] == kFaceDrawn) {
      const auto shape = static_cast<std::uint8_t>((flat >> i & 1) * kFaceDegenerate |
                                                   (back >> i & 1) * kFaceCulled);
      reject[i] = (small >> i & 1) != 0 ? shape : ShapeReject(SnapFace(mesh, f + i), cull_back);
    }
    drawn |= static_cast<std::uint32_t>(reject[i] == kFaceDrawn) << i;
  }
  return drawn;
}

void SetWideDepths(const ScreenMesh& mesh, DrawnFace* first, DrawnFace* end) {
  for (; first != end; ++first) {
    if (first->pixels != DrawnFace::kByTiles) continue;
    first->depth = WideDepthPlane(mesh, static_cast<std::size_t>(first->face));
  }
}

// Bit kStamp * row + column: the face covers that pixel of its box. Goes from the last pixel to the
// first and shifts the result up by one bit per pixel, which needs no constants.
HWY_INLINE FaceInt CoveredOf(const FaceWords& words) {
  const FaceIntTag di;
  static_assert(kStamp == 4);
  FaceInt across[3], down[3], row_edge[3];
  for (int k = 0; k < 3; ++k) {
    across[k] = words.word[kEdgeWord + 3 + k];
    down[k] = words.word[kEdgeWord + 6 + k];
    const auto both = hn::Add(across[k], down[k]);
    row_edge[k] = hn::Add(words.word[kEdgeWord + k], hn::Add(both, hn::Add(both, both)));
  }
  FaceInt outside = hn::Zero(di);  // minus the bits
  for (int row = kStamp - 1; row >= 0; --row) {
    FaceInt edge[3] = {row_edge[0], row_edge[1], row_edge[2]};
    for (int column = kStamp - 1; column >= 0; --column) {
      const auto here = hn::ShiftRight<31>(hn::Or(hn::Or(edge[0], edge[1]), edge[2]));
      outside = hn::Add(hn::Add(outside, outside), here);
      for (int k = 0; k < 3; ++k) edge[k] = hn::Sub(edge[k], across[k]);
    }
    for (int k = 0; k < 3; ++k) row_edge[k] = hn::Sub(row_edge[k], down[k]);
  }
  return hn::Add(outside, hn::Set(di, (1 << kStamp * kStamp) - 1));
}

HWY_INLINE FaceIntMask FitsStamp(const ShapeLanes& shapes, const PixelLanes& columns,
                                 const PixelLanes& rows) {
  const auto fits = [&](const PixelLanes& pixels) HWY_ATTR {
    return hn::Lt(hn::Sub(pixels.end, pixels.begin), hn::Set(FaceIntTag(), kStamp + 1));
  };
  return hn::And(shapes.small, hn::And(fits(columns), fits(rows)));
}

// Writes the records of those faces in `keep` that may cover a pixel. Returns their number.
HWY_INLINE std::size_t ListFaces(const ScreenMesh& mesh, const ShapeCorners& corners,
                                 ShapeLanes* shapes, std::size_t f, std::uint32_t drawn,
                                 const FaceList& to) {
  const FaceIntTag di;
  const PixelLanes columns = PixelsOf(shapes->x, mesh.width),
                   rows = PixelsOf(shapes->y, mesh.height);
  const auto covers = hn::And(hn::Lt(columns.begin, columns.end), hn::Lt(rows.begin, rows.end));
  std::uint32_t keep = drawn & BitsOf(FaceIntTag(), covers);
  if (keep == 0) return 0;
  FaceWords words;
  WindClockwise(shapes->area, &shapes->corners);
  SetEdges(shapes->corners, columns.begin, rows.begin, &words);
  const auto stamped = FitsStamp(*shapes, columns, rows);
  words.word[1] = hn::IfThenElseZero(shapes->small, hn::Set(di, DrawnFace::kByEdges));
  const std::uint32_t stamps = BitsOf(FaceIntTag(), stamped);
  if ((keep & stamps) != 0) {
    const auto covered = CoveredOf(words);
    words.word[1] = hn::IfThenElse(stamped, covered, words.word[1]);
    keep &= ~(stamps & BitsOf(FaceIntTag(), hn::Eq(covered, hn::Zero(di))));
    if (keep == 0) return 0;
  }
  words.word[0] = simd::CountFrom(di, static_cast<std::int32_t>(f));
  words.word[2] = hn::Or(columns.begin, hn::ShiftLeft<16>(columns.end));
  words.word[3] = hn::Or(rows.begin, hn::ShiftLeft<16>(rows.end));
  SetDepth(corners, &words);
  StoreBins(BinWords(columns, rows, mesh.width), keep, to.bins);
  if ((keep & ~stamps) == 0) {
    StoreRecords<kPiecesWithoutEdges>(words, keep, to.face);
  } else {
    DrawnFace* const end = StoreRecords<kPieces>(words, keep, to.face);
    if ((keep & ~BitsOf(FaceIntTag(), shapes->small)) != 0) SetWideDepths(mesh, to.face, end);
  }
  return static_cast<std::size_t>(std::popcount(keep));
}

static_assert(kMostFaceLanes <= kPacketFaces);

// Faces f to f + count - 1. Lanes beyond, and faces outside the soft mask, are moved out of reach.
HWY_INLINE void StoreCorners(const ShapeCorners& c, std::size_t f, std::size_t count,
                             const std::uint8_t* reject, CornerPackets* to) {
  const FaceTag d;
  const FaceIntTag di;
  const hn::Rebind<std::uint8_t, FaceTag> bytes;
  HWY_ALIGN std::uint8_t some[kMostFaceLanes];
  if (count < hn::Lanes(d)) {
    std::fill(std::copy_n(reject, count, some), some + kMostFaceLanes, kFaceNotInSoftMask);
    reject = some;
  }
  const auto why = hn::PromoteTo(di, hn::LoadU(bytes, reject));
  const auto out_of_it = hn::And(why, hn::Set(di, std::int32_t{kFaceNotInSoftMask}));
  const auto nowhere = hn::RebindMask(d, hn::Gt(out_of_it, hn::Zero(di)));
  for (std::size_t k = 0; k < 3; ++k) {
    const auto store = [&](FaceVec v, std::size_t number) HWY_ATTR {
      hn::Store(hn::IfThenElse(nowhere, hn::Set(d, kNowhere), v), d,
                to->at(f / kPacketFaces, number) + f % kPacketFaces);
    };
    store(c.x[k], k);
    store(c.y[k], 3 + k);
  }
}

// `corner_packets` may be null. `out` has null, or room for all of the faces. Returns the number of
// records written.
std::size_t SetUpSomeFaces(const ScreenMesh& mesh, const SomeFaces& range, std::uint8_t* reject,
                           CornerPackets* corner_packets, const FaceList& out) {
  const std::size_t lanes = hn::Lanes(FaceIntTag());
  std::size_t listed = 0;
  for (std::size_t f = range.begin; f < range.end; f += lanes) {
    const std::size_t count = HWY_MIN(lanes, range.end - f);
    const ShapeCorners corners = LoadShapeCorners(mesh, f, count);
    ShapeLanes shapes = ShapesOf(corners);
    const std::uint32_t drawn = RejectShapes(mesh, shapes, range.cull_back, f, count, reject + f);
    if (corner_packets != nullptr) StoreCorners(corners, f, count, reject + f, corner_packets);
    if (out.face == nullptr || drawn == 0) continue;
    listed += ListFaces(mesh, corners, &shapes, f, drawn, {out.face + listed, out.bins + listed});
  }
  return listed;
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

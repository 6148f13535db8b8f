// SPDX-License-Identifier: Apache-2.0
// Which feature of a face is nearest to the pixels of a block: one corner, the inside of one edge,
// one edge, or it varies ("Nearest features"). Lanes are faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_FEATURES_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <initializer_list>

#include "base/simd_math-inl.h"
#include "raster/soft_mask/faces-inl.h"
#include "raster/soft_mask/setup.h"
#include "raster/soft_mask/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// The pixels of a block within reach of a face: those of an octagon around it. Lanes are faces.

using SoftByteTag = hn::Repartition<std::uint8_t, SoftTag>;
using SoftBytes = hn::Vec<SoftByteTag>;
using SoftBitsTag = hn::Repartition<std::uint64_t, SoftTag>;
using SoftBits = hn::Vec<SoftBitsTag>;  // pixels of a block, for half of the faces

// The pixels of a block in one direction: columns, rows, or the diagonals of equal x + y or x - y.
// Offsets that map the low or high end of a face, in pixels, to the index of the first pixel within
// reach or the first one beyond; and their number.
struct PixelAxis {
  float low, high, count;

  // In pixels: the position of the first one, and the reach of a kernel. 1/64 covers rounding, of
  // which that relative to `reach` is in `reach`, and ties, which may round to the even neighbour.
  PixelAxis(float first, float reach, float pixels)
      : low((0.5f - kRounding) - (first + reach)),
        high((0.5f + kRounding) + (reach - first)),
        count(pixels) {}

 private:
  static constexpr float kRounding = 1.0f / 64;
};

// The directions of a block, computed once: compilers would recompute them for every vector of
// faces, since lists are written in between.
struct BlockAxes {
  PixelAxis columns, rows, sums, differences;

  BlockAxes(const SoftBlock& block, const SoftReach& reach) : BlockAxes(At(block), reach) {}

 private:
  static constexpr float kLast = kBlockSize - 1, kStraight = kBlockSize, kDiagonals = 2 * kLast + 1;
  struct Corner {
    float x, y;  // of the first pixel
  };
  static Corner At(const SoftBlock& block) {
    return {static_cast<float>(block.x0) + 0.5f, static_cast<float>(block.y0) + 0.5f};
  }
  BlockAxes(const Corner& at, const SoftReach& reach)
      : columns(at.x, reach.columns, kStraight),
        rows(at.y, reach.rows, kStraight),
        sums(at.x + at.y, reach.diagonals, kDiagonals),
        differences(at.x - at.y - kLast, reach.diagonals, kDiagonals) {}
};

// The first pixel and the one after the last, in the lowest byte of each face's four.
struct PixelRange {
  SoftBytes begin, end;

  HWY_INLINE PixelRange(SoftTag d, const float* low, const float* high, const PixelAxis& axis) {
    constexpr float kLarge = 0x1p23f;  // adding it moves the integer into the lowest bits
    const auto nearest = [&](const float* at, float shift) HWY_ATTR {
      const SoftVec index = hn::Add(hn::Load(d, at), hn::Set(d, shift));
      const SoftVec clamped = hn::Min(hn::Max(index, hn::Zero(d)), hn::Set(d, axis.count));
      return hn::BitCast(SoftByteTag(), hn::Add(clamped, hn::Set(d, kLarge)));
    };
    begin = nearest(low, axis.low);
    end = nearest(high, axis.high);
  }
};

// Tables of bytes.
struct PixelBytes {
  // For each half of four numbers of four bytes: eight times the half's first number, then its
  // second.
  alignas(16) std::uint8_t spread[2][16] = {};
  alignas(16) std::uint8_t below[16] = {};                // bits of the columns less than the index
  alignas(16) std::uint8_t row[16] = {}, above[16] = {};  // 0 to 7, 7 to 0
  constexpr PixelBytes() {
    for (std::uint8_t i = 0; i < 16; ++i) {
      below[i] = static_cast<std::uint8_t>(i < 8 ? (1 << i) - 1 : 0xff);
      row[i] = i % 8;
      above[i] = static_cast<std::uint8_t>(7 - i % 8);
      for (std::uint8_t half = 0; half < 2; ++half) {
        spread[half][i] = static_cast<std::uint8_t>(4 * (2 * half + i / 8));
      }
    }
  }
};
inline constexpr PixelBytes kPixelBytes;

// The ranges of a face's octagon; the last of x - y + 7.
struct PixelOctagon {
  PixelRange columns, rows, sums, differences;

  // Pixels of the faces of one half of each block of vectors.
  HWY_INLINE SoftBits PixelsOfHalf(std::size_t half) const {
    const SoftByteTag d;
    const hn::RebindToSigned<SoftByteTag> di;  // numbers up to 15, which compare faster
    const auto table = [&](const std::uint8_t(&t)[16]) HWY_ATTR { return hn::LoadDup128(d, t); };
    const auto spread = [&](SoftBytes v) HWY_ATTR {
      return hn::TableLookupBytes(v, table(kPixelBytes.spread[half]));
    };
    const auto between = [&](SoftBytes begin, SoftBytes end) HWY_ATTR {
      const SoftBytes below = table(kPixelBytes.below);
      return hn::AndNot(hn::TableLookupBytes(below, begin), hn::TableLookupBytes(below, end));
    };
    const auto slanted = [&](const PixelRange& range, SoftBytes by) HWY_ATTR {
      return between(hn::SaturatedSub(spread(range.begin), by),
                     hn::SaturatedSub(spread(range.end), by));
    };
    const SoftBytes row = table(kPixelBytes.row), above = table(kPixelBytes.above);
    const auto rows_below = [&](SoftBytes n) HWY_ATTR {
      const auto is_below = hn::Lt(hn::BitCast(di, row), hn::BitCast(di, spread(n)));
      return hn::BitCast(d, hn::VecFromMask(di, is_below));
    };
    const SoftBytes in_columns = between(spread(columns.begin), spread(columns.end));
    const SoftBytes in_rows = hn::AndNot(rows_below(rows.begin), rows_below(rows.end));
    const SoftBytes in_diagonals = hn::And(slanted(sums, row), slanted(differences, above));
    return hn::BitCast(SoftBitsTag(), hn::And(hn::And(in_columns, in_rows), in_diagonals));
  }
};

// Pixels that see faces, one vector of faces in two halves.
struct FacePixels {
  SoftBits first, second;

  HWY_INLINE explicit FacePixels(const PixelOctagon& octagon) {
    const SoftBitsTag d;
    const SoftBits low = octagon.PixelsOfHalf(0), high = octagon.PixelsOfHalf(1);
    first = low;
    second = high;
    if constexpr (hn::MaxLanes(SoftTag()) > 4) {  // each block of a vector has its halves
      first = hn::ConcatLowerLower(d, high, low);
      second = hn::ConcatUpperUpper(d, high, low);
    }
  }
  HWY_INLINE void Store(std::uint64_t* to) const {
    const SoftBitsTag d;
    hn::Store(first, d, to);
    hn::Store(second, d, to + hn::Lanes(d));
  }
  // Bits of the faces that none of `pixels` sees.
  HWY_INLINE std::uint32_t UnseenBy(std::uint64_t pixels) const {
    const SoftBits among = hn::Set(SoftBitsTag(), pixels);
    return Zeros(hn::And(first, among), hn::And(second, among));
  }
  // Bits of the faces that all of `pixels` see.
  HWY_INLINE std::uint32_t SeenByAll(std::uint64_t pixels) const {
    const SoftBits among = hn::Set(SoftBitsTag(), pixels);
    return Zeros(hn::AndNot(first, among), hn::AndNot(second, among));
  }

 private:
  static HWY_INLINE std::uint32_t Zeros(SoftBits a, SoftBits b) {
    const SoftBitsTag d;
    const auto half = [&](SoftBits v) HWY_ATTR { return BitsOf(d, hn::Eq(v, hn::Zero(d))); };
    return half(a) | half(b) << hn::Lanes(d);
  }
};

// The pixels of a block that see faces i, i + 1, ...
HWY_INLINE FacePixels PixelsOfFaces(SoftTag d, const SoftFaceArrays& faces, std::size_t i,
                                    const BlockAxes& axes) {
  using A = SoftFaceArrays;
  const auto range = [&](A::Array low, A::Array high, const PixelAxis& axis) HWY_ATTR {
    return PixelRange(d, faces.v[low] + i, faces.v[high] + i, axis);
  };
  return FacePixels({range(A::kLeft, A::kRight, axes.columns),
                     range(A::kTop, A::kBottom, axes.rows),
                     range(A::kLeastSum, A::kMostSum, axes.sums),
                     range(A::kLeastDifference, A::kMostDifference, axes.differences)});
}

// Lanes of faces i, i + 1, ... whose box is within `reach` of the block's background.
HWY_INLINE SoftMask BoxesNear(SoftTag d, const SoftFaceArrays& faces, std::size_t i,
                              const SoftBlock& block, float reach) {
  const auto side = [&](SoftFaceArrays::Array a) HWY_ATTR { return hn::Load(d, faces.v[a] + i); };
  const SoftVec z =
      BoxDistance(d, side(SoftFaceArrays::kLeft), side(SoftFaceArrays::kTop),
                  side(SoftFaceArrays::kRight), side(SoftFaceArrays::kBottom), block.box);
  return hn::Le(z, hn::Set(d, reach * reach));
}

// Selects one of three per lane.
template <class V, class M>
HWY_INLINE V Pick(const V (&v)[3], M first, M second) {
  return hn::IfThenElse(first, v[0], hn::IfThenElse(second, v[1], v[2]));
}

// Appends members at `at`, a copy of the list's count: compilers would reload the count after each
// vector store.
HWY_INLINE void AppendTags(SoftInt slot, SoftInt part, const Compactor& compact, std::size_t at,
                           SoftList* to) {
  compact.Store(slot, to->slot + at);
  compact.Store(part, to->part + at);
  to->count = at + compact.count();
}

// 0, 1 or 2 by lanes.
HWY_INLINE SoftInt PartOf(SoftMask first, SoftMask second) {
  const SoftIntTag di;
  const SoftInt parts[3] = {hn::Zero(di), hn::Set(di, 1), hn::Set(di, 2)};
  return Pick(parts, hn::RebindMask(di, first), hn::RebindMask(di, second));
}

HWY_INLINE void AppendEdges(SoftTag d, const FaceEdges& f, SoftInt slot, SoftMask keep,
                            const SoftMask (&only)[3], SoftListOf<SoftLists::kEdgeArrays>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  const std::size_t at = to->count;
  const auto append = [&](SoftLists::Edge a, const SoftVec(&v)[3])
                          HWY_ATTR { compact.Store(Pick(v, only[0], only[1]), to->v[a] + at); };
  append(SoftLists::kTx, f.tx);
  append(SoftLists::kTy, f.ty);
  append(SoftLists::kSide, f.side);
  append(SoftLists::kFirst, f.first);
  append(SoftLists::kLast, f.last);
  append(SoftLists::kInverse, f.inverse);
  AppendTags(slot, PartOf(only[0], only[1]), compact, at, to);
}

HWY_INLINE void AppendVertices(SoftTag d, const FaceEdges& f, SoftInt slot, SoftMask keep,
                               const SoftMask (&only)[3], SoftListOf<2>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  const std::size_t at = to->count;
  compact.Store(Pick(f.x, only[0], only[1]), to->v[0] + at);
  compact.Store(Pick(f.y, only[0], only[1]), to->v[1] + at);
  AppendTags(slot, PartOf(only[0], only[1]), compact, at, to);
}

HWY_INLINE void AppendBoundaries(SoftTag d, const FaceEdges& f, SoftInt slot, SoftMask keep,
                                 SoftListOf<3 * SoftLists::kEdgeArrays>* to) {
  if (hn::AllFalse(d, keep)) return;
  const Compactor compact(d, keep);
  const std::size_t at = to->count;
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftVec edge[] = {f.tx[k], f.ty[k], f.side[k], f.first[k], f.last[k], f.inverse[k]};
    for (std::size_t a = 0; a < SoftLists::kEdgeArrays; ++a) {
      compact.Store(edge[a], to->v[k * SoftLists::kEdgeArrays + a] + at);
    }
  }
  AppendTags(slot, hn::Zero(SoftIntTag()), compact, at, to);
}

// The `pixels` of a block to find features for. If `split`, faces nearer than `reach.near` become
// boundaries, whichever feature is nearest.
struct FeatureSearch {
  const SoftBlock& block;
  std::uint64_t pixels;
  const SoftReach& reach;
  bool split;
  // Derived values, computed once for all faces ("Nearest features"). Whether to look for edges
  // behind: if a block is larger than faces reach, faces lie all around its pixels.
  const bool looks_behind = block.half_x + block.half_y < 2 * reach.root;
  // Exceeds the rounding of distances to edge lines: 32 u of their largest term.
  const float rounding = 0x1p-19f * (block.half_x + block.half_y + 2 * reach.root +
                                     kLongEdge * (block.box.unit_x + block.box.unit_y));
};

// Some faces: all, and the not near ones; their positions in the chunk.
struct FeatureFaces {
  SoftMask all, far;
  SoftInt slot;
};

// Edges that have the block's pixels on their inner side, where none can lie within the face:
// nearest points on them are on another edge, too.
HWY_INLINE void EdgesBehind(SoftTag d, const FaceEdges& f, const FeatureSearch& search,
                            SoftMask (&behind)[3]) {
  const SoftBlock& block = search.block;
  SoftMask ahead[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftVec half = hn::MulAdd(hn::Abs(f.ty[k]), hn::Set(d, block.half_x),
                                    hn::Mul(hn::Abs(f.tx[k]), hn::Set(d, block.half_y)));
    const SoftVec least = hn::Add(half, hn::Set(d, search.rounding));
    const SoftVec inner = hn::CopySign(f.side[k], hn::Xor(f.side[k], f.turn));
    behind[k] = hn::Lt(least, inner);
    ahead[k] = hn::Lt(inner, hn::Neg(least));
  }
  const SoftMask sure = hn::Ne(f.turn, hn::Zero(d));
  const SoftMask outside = hn::And(sure, hn::Or(hn::Or(ahead[0], ahead[1]), ahead[2]));
  for (SoftMask& b : behind) b = hn::And(b, outside);
}

// Edges whose first or last corner is the nearest point for all pixels of a block.
struct EdgeEnds {
  SoftMask start[3], end[3];
};

// Faces whose nearest point is on a single edge, by edge, unless it is a corner ("Nearest
// features").
HWY_INLINE void FindOnlyEdges(SoftTag d, const FaceEdges& f, const FeatureSearch& search,
                              const EdgeEnds& at, SoftMask (&only)[3]) {
  if (!search.looks_behind) {
    for (std::size_t k = 0; k < 3; ++k) {
      only[k] = hn::And(at.start[(k + 1) % 3], at.end[(k + 2) % 3]);
    }
    return;
  }
  SoftMask behind[3], gone[3];
  EdgesBehind(d, f, search, behind);
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftMask at_start = hn::AndNot(behind[(k + 2) % 3], at.start[k]);
    const SoftMask at_end = hn::AndNot(behind[(k + 1) % 3], at.end[k]);
    gone[k] = hn::Or(behind[k], hn::Or(at_start, at_end));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    only[k] = hn::AndNot(gone[k], hn::And(gone[(k + 1) % 3], gone[(k + 2) % 3]));
  }
}

HWY_INLINE void AppendFeatures(SoftTag d, const FaceEdges& f, const FeatureFaces& faces,
                               const FeatureSearch& search, SoftLists* lists) {
  const SoftBlock& block = search.block;
  EdgeEnds at;
  for (std::size_t k = 0; k < 3; ++k) {
    const SoftVec half = hn::MulAdd(hn::Abs(f.tx[k]), hn::Set(d, block.half_x),
                                    hn::Mul(hn::Abs(f.ty[k]), hn::Set(d, block.half_y)));
    at.start[k] = hn::Le(half, f.first[k]);
    at.end[k] = hn::Le(half, hn::Neg(f.last[k]));
  }
  const SoftMask corner[3] = {hn::And(at.start[0], at.end[2]), hn::And(at.start[1], at.end[0]),
                              hn::And(at.start[2], at.end[1])};
  SoftMask edge[3];
  FindOnlyEdges(d, f, search, at, edge);
  const SoftMask vertex = hn::And(faces.far, hn::Or(hn::Or(corner[0], corner[1]), corner[2]));
  const SoftMask segment =
      hn::AndNot(vertex, hn::And(faces.far, hn::Or(hn::Or(edge[0], edge[1]), edge[2])));
  AppendVertices(d, f, faces.slot, vertex, corner, &lists->vertices);
  AppendEdges(d, f, faces.slot, segment, edge, &lists->segments);
  AppendBoundaries(d, f, faces.slot, hn::AndNot(hn::Or(vertex, segment), faces.all),
                   &lists->boundaries);
}

// Pads a list to whole vectors: `far` are its arrays of distances.
template <std::size_t kArrays>
HWY_INLINE void PadList(std::initializer_list<std::size_t> far, SoftListOf<kArrays>* list) {
  const SoftTag d;
  const SoftIntTag di;
  if (list->count % hn::Lanes(d) == 0) return;
  for (auto& array : list->v) hn::StoreU(hn::Zero(d), d, array + list->count);
  hn::StoreU(hn::Set(di, SoftList::kNoSlot), di, list->slot + list->count);
  for (const std::size_t a : far) hn::StoreU(hn::Set(d, 1e15f), d, list->v[a] + list->count);
}

// Vectors with a near face: their first faces, and the lanes that are near.
struct NearVectors {
  std::size_t count = 0;
  std::int32_t first[kChunkRoom];
  std::uint8_t lanes[kChunkRoom];  // bits

  // Branch-free: a branch would be hard to predict.
  HWY_INLINE NearVectors(SoftTag d, const SoftFaceArrays& faces, const FeatureSearch& search) {
    for (std::size_t i = 0; i < faces.count; i += hn::Lanes(d)) {
      const SoftMask near = hn::And(BoxesNear(d, faces, i, search.block, search.reach.root),
                                    hn::FirstN(d, faces.count - i));
      first[count] = static_cast<std::int32_t>(i);
      lanes[count] = static_cast<std::uint8_t>(BitsOf(d, near));
      count += lanes[count] != 0;
    }
  }
};

// Fills `lists` with the members of the block among the faces of a chunk.
inline void FindFeatures(const SoftChunk& chunk, const SoftMaskPlan& plan,
                         const FeatureSearch& search, SoftLists* lists) {
  const SoftTag d;
  const SoftIntTag di;
  const BlockAxes axes(search.block, search.reach);
  lists->vertices.count = lists->segments.count = lists->boundaries.count = lists->whole = 0;
  const auto append = [&](const SoftFaceArrays& faces, std::size_t first_slot,
                          const auto& edges) HWY_ATTR {
    const NearVectors near(d, faces, search);
    for (std::size_t n = 0; n < near.count; ++n) {
      const auto i = static_cast<std::size_t>(near.first[n]), slot = first_slot + i;
      const FacePixels pixels = PixelsOfFaces(d, faces, i, axes);
      const std::uint32_t seen_bits = near.lanes[n] & ~pixels.UnseenBy(search.pixels);
      if (seen_bits == 0) continue;
      pixels.Store(lists->pixels + slot);
      lists->whole +=
          static_cast<std::size_t>(std::popcount(seen_bits & pixels.SeenByAll(search.block.bits)));
      const SoftMask seen = MaskOf(d, seen_bits);
      SoftMask far = seen;
      if (search.split) {
        far = hn::AndNot(BoxesNear(d, faces, i, search.block, search.reach.near), seen);
      }
      const SoftInt slots = simd::CountFrom(di, static_cast<std::int32_t>(slot));
      AppendFeatures(d, edges(i), {seen, far, slots}, search, lists);
    }
  };
  append(chunk.shorts, 0, [&](std::size_t i) HWY_ATTR {
    FaceEdges f;
    LoadCorners(d, chunk.shorts, i, search.block, &f);
    ShortEdges(d, chunk.shorts, i, &f);
    return f;
  });
  append(chunk.longs, kChunkRoom,
         [&](std::size_t i) HWY_ATTR { return LongEdges(d, chunk.longs, i, plan, search.block); });
  PadList({0}, &lists->vertices);
  PadList({SoftLists::kSide}, &lists->segments);
  PadList({SoftLists::kSide, SoftLists::kEdgeArrays + SoftLists::kSide,
           2 * SoftLists::kEdgeArrays + SoftLists::kSide},
          &lists->boundaries);
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// Which pixels of a block are within reach of a face: those of an octagon around it. Lanes are
// faces.

#if defined(TILEGRAD_RASTER_SOFT_MASK_PIXELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_PIXELS_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_PIXELS_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_PIXELS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "raster/soft_mask/setup.h"
#include "raster/soft_mask/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

using SoftByteTag = hn::Repartition<std::uint8_t, SoftTag>;
using SoftBytes = hn::Vec<SoftByteTag>;
using SoftBitsTag = hn::Repartition<std::uint64_t, SoftTag>;
using SoftBits = hn::Vec<SoftBitsTag>;  // pixels of a block, for half of the faces

// The pixels of a block in one direction: columns, rows, or the diagonals of equal x + y or x - y.
// What brings the low or high end of a face, in pixels, to the index of the first one within reach
// or the first one behind; how many there are.
struct PixelAxis {
  float low, high, count;

  // In pixels: where the first one lies, and how far a kernel reaches. 1/64 covers rounding, of
  // which that relative to `reach` is in `reach`, and ties, which may become the even neighbour.
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

// The first and the one behind the last, in the lowest byte of each face's four.
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
  // For each half of four numbers of four bytes: eight times its first one, then its second.
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

// The ranges that a face's octagon is made of; the last of x - y + 7.
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

// Pixels that see faces, a vector of them in two.
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

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// Vector body of seen_faces.h: lanes are the pixels of a row.
#if defined(TILEGRAD_RASTER_SEEN_FACES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SEEN_FACES_INL_H_
#undef TILEGRAD_RASTER_SEEN_FACES_INL_H_
#else
#define TILEGRAD_RASTER_SEEN_FACES_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>

#include "raster/face_lanes-inl.h"
#include "raster/seen_faces.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Gives the face of pixel (x, y) the next slot if it has none. Branch-free: a branch is hard to
// predict.
HWY_INLINE void NumberPixel(std::int32_t face, float x, float y, SeenFaces* seen) {
  std::int32_t* slot = seen->slot_of_face.data() + 1 + face;
  const std::int32_t found = *slot, fresh = found >> 31;
  const auto next = static_cast<std::int32_t>(seen->count);
  *slot = (next & fresh) | (found & ~fresh);
  seen->face[seen->count] = face;
  seen->origin_x[seen->count] = x;
  seen->origin_y[seen->count] = y;
  seen->count += static_cast<std::size_t>(-fresh);
}

// Bit p: pixel p shows a face that neither its left neighbour nor the pixel above it shows. `above`
// null: first row of the band.
HWY_INLINE std::uint32_t NewFaceBits(const std::int32_t* faces, const std::int32_t* above) {
  const FaceIntTag di;
  const auto here = hn::LoadU(di, faces);
  const auto is_not = [&](const std::int32_t* other)
                          HWY_ATTR { return hn::Ne(here, hn::LoadU(di, other)); };
  auto fresh = hn::And(hn::Gt(here, hn::Set(di, kNoFace)), is_not(faces - 1));
  if (above != nullptr) fresh = hn::And(fresh, is_not(above));
  return BitsOf(di, fresh);
}

HWY_INLINE void NumberRow(const FaceRows& rows, int i, SeenFaces* seen) {
  const int lanes = static_cast<int>(hn::Lanes(FaceIntTag()));
  const std::int32_t* row = rows.row(i);
  const std::int32_t* above = i == rows.row_begin ? nullptr : rows.row(i - 1);
  const float y = static_cast<float>(i) + 0.5f;
  const auto number = [&](int j) HWY_ATTR {
    NumberPixel(row[j], static_cast<float>(rows.x0 + j) + 0.5f, y, seen);
  };
  if (rows.width <= lanes) {
    for (int j = 0; j < rows.width; ++j) number(j);
    return;
  }
  number(0);
  for (int j = 1; j < rows.width;) {
    // As many pixels as bits at a time: the end of the loop over bits is hard to predict.
    const int first = j;
    std::uint64_t bits = 0;
    while (j < rows.width && j - first <= 64 - lanes) {
      // The last vector overlaps the previous one: a scalar tail would be a chain of dependent
      // steps.
      const int at = HWY_MIN(j, rows.width - lanes);
      const std::uint64_t here = NewFaceBits(row + at, above == nullptr ? nullptr : above + at);
      bits |= here >> (j - at) << (j - first);
      j = at + lanes;
    }
    for (; bits != 0; bits &= bits - 1) number(first + std::countr_zero(bits));
  }
}

// The arrays by slot have room for one slot more than can be in use.
void NumberAllRows(const FaceRows& rows, SeenFaces* seen) {
  seen->count = 1;
  for (int i = rows.row_begin; i < rows.row_end; ++i) NumberRow(rows, i, seen);
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

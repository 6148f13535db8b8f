// SPDX-License-Identifier: Apache-2.0
// Lanes are faces: loading their corners.
#if defined(TILEGRAD_RASTER_FACE_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_FACE_LANES_INL_H_
#undef TILEGRAD_RASTER_FACE_LANES_INL_H_
#else
#define TILEGRAD_RASTER_FACE_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "raster/conventions.h"
#include "raster/screen_mesh.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr std::size_t kMostFaceLanes = 16;
using FaceTag = HWY_CAPPED(float, kMostFaceLanes);
using FaceIntTag = hn::RebindToSigned<FaceTag>;
using FaceVec = hn::Vec<FaceTag>;
using FaceInt = hn::Vec<FaceIntTag>;
using FaceIntMask = hn::Mask<FaceIntTag>;

// Bit i: lane i, of up to 16.
template <class D>
HWY_INLINE std::uint32_t BitsOf(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  if constexpr (hn::MaxLanes(D()) <= 8) return bytes[0];
  if constexpr (std::endian::native == std::endian::little) {
    std::uint16_t both;
    std::memcpy(&both, bytes, sizeof(both));  // compilers see one number
    return both;
  }
  return static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8;
}
// The inverse.
template <class D>
HWY_INLINE hn::Mask<D> MaskOf(D d, std::uint32_t bits) {
  const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(bits),
                                 static_cast<std::uint8_t>(bits >> 8)};  // all of them are read
  return hn::LoadMaskBits(d, bytes);
}

// The first `count` lanes; lanes beyond repeat the first.
HWY_INLINE FaceInt LoadSome(const std::int32_t* from, std::size_t count) {
  const FaceIntTag di;
  if (count >= hn::Lanes(di)) return hn::LoadU(di, from);
  HWY_ALIGN std::int32_t values[kMostFaceLanes];
  for (std::size_t i = 0; i < hn::Lanes(di); ++i) values[i] = from[i < count ? i : 0];
  return hn::Load(di, values);
}

using QuadTag = hn::FixedTag<float, 4>;
using Quad = hn::Vec<QuadTag>;

// Transposes each block of four lanes in place: from four vectors of (0, 1, 2, 3) to one vector of
// number 0, one of number 1, and so on.
template <class D>
HWY_INLINE void Transpose(D d, hn::Vec<D> (&q)[4]) {
  const auto a = hn::InterleaveLower(d, q[0], q[2]), b = hn::InterleaveLower(d, q[1], q[3]);
  const auto e = hn::InterleaveUpper(d, q[0], q[2]), f = hn::InterleaveUpper(d, q[1], q[3]);
  q[0] = hn::InterleaveLower(d, a, b);
  q[1] = hn::InterleaveUpper(d, a, b);
  q[2] = hn::InterleaveLower(d, e, f);
  q[3] = hn::InterleaveUpper(d, e, f);
}

#if !HWY_HAVE_SCALABLE
// Four numbers of lanes i, i + 4, i + 8, ..., a block of the vector each.
template <class D, class At>
HWY_INLINE hn::Vec<D> LoadBlocks(D d, const At& at, std::size_t i) {
  if constexpr (std::is_same_v<D, QuadTag>) {
    return hn::LoadU(d, at(i));
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, LoadBlocks(half, at, i + hn::MaxLanes(half)), LoadBlocks(half, at, i));
  }
}
#endif

// Four numbers from at(i) on for each lane i, transposed: out[c] holds number c of all lanes.
// Several times faster than gathers.
template <class D, class At>
HWY_INLINE void LoadQuads(D d, const At& at, hn::Vec<D> (&out)[4]) {
#if HWY_HAVE_SCALABLE
  HWY_ALIGN float numbers[4 * kMostFaceLanes];
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
    hn::Store(hn::LoadU(QuadTag(), at(i)), QuadTag(), numbers + 4 * i);
  }
  hn::LoadInterleaved4(d, numbers, out[0], out[1], out[2], out[3]);
#else
  for (std::size_t i = 0; i < 4; ++i) out[i] = LoadBlocks(d, at, i);
  Transpose(d, out);
#endif
}

// Vertices of a corner: x, y, 1/depth, depth. `vertex` [lanes].
HWY_INLINE void LoadVertices(const ScreenMesh& mesh, const std::int32_t* vertex,
                             FaceVec (&out)[4]) {
  const auto at = [&](std::size_t i)
                      HWY_ATTR { return &mesh.packed[static_cast<std::size_t>(vertex[i])].x; };
  LoadQuads(FaceTag(), at, out);
}

// Four pixels.
using QuadIntTag = hn::RebindToSigned<QuadTag>;

// Which pixels show a face.
HWY_INLINE hn::Mask<QuadTag> SeesFace(const std::int32_t* faces) {
  const QuadIntTag di;
  return hn::RebindMask(QuadTag(), hn::Gt(hn::LoadU(di, faces), hn::Set(di, kNoFace)));
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Lanes are faces: loading their corners.
#if defined(TILEGRAD_RASTER_FACE_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_FACE_LANES_INL_H_
#undef TILEGRAD_RASTER_FACE_LANES_INL_H_
#else
#define TILEGRAD_RASTER_FACE_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>
#include <type_traits>

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

// The first `count` lanes; the first of them again where there are more.
HWY_INLINE FaceInt LoadSome(const std::int32_t* from, std::size_t count) {
  const FaceIntTag di;
  if (count >= hn::Lanes(di)) return hn::LoadU(di, from);
  HWY_ALIGN std::int32_t values[kMostFaceLanes];
  for (std::size_t i = 0; i < hn::Lanes(di); ++i) values[i] = from[i < count ? i : 0];
  return hn::Load(di, values);
}

using QuadTag = hn::FixedTag<float, 4>;
using Quad = hn::Vec<QuadTag>;

// From four numbers of four to four of number 0, of number 1, and so on, in place.
HWY_INLINE void Transpose(Quad (&q)[4]) {
  const QuadTag d;
  const Quad a = hn::InterleaveLower(d, q[0], q[2]), b = hn::InterleaveLower(d, q[1], q[3]);
  const Quad e = hn::InterleaveUpper(d, q[0], q[2]), f = hn::InterleaveUpper(d, q[1], q[3]);
  q[0] = hn::InterleaveLower(d, a, b), q[1] = hn::InterleaveUpper(d, a, b);
  q[2] = hn::InterleaveLower(d, e, f), q[3] = hn::InterleaveUpper(d, e, f);
}

// Four numbers from at(i) on for each lane i, transposed: out[c] holds number c of all lanes.
// Several times faster than gathers.
template <class D, class At>
HWY_INLINE void LoadQuads(D d, const At& at, std::size_t first, hn::Vec<D> (&out)[4]) {
#if HWY_HAVE_SCALABLE
  (void)first;
  HWY_ALIGN float numbers[4 * kMostFaceLanes];
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
    hn::Store(hn::LoadU(QuadTag(), at(i)), QuadTag(), numbers + 4 * i);
  }
  hn::LoadInterleaved4(d, numbers, out[0], out[1], out[2], out[3]);
#else
  if constexpr (std::is_same_v<D, QuadTag>) {
    for (std::size_t i = 0; i < 4; ++i) out[i] = hn::LoadU(d, at(first + i));
    Transpose(out);
  } else {
    const hn::Half<D> half;
    hn::Vec<decltype(half)> lower[4], upper[4];
    LoadQuads(half, at, first, lower);
    LoadQuads(half, at, first + hn::MaxLanes(half), upper);
    for (int c = 0; c < 4; ++c) out[c] = hn::Combine(d, upper[c], lower[c]);
  }
#endif
}

// Vertices of a corner: x, y, 1/depth, depth. `vertex` [lanes].
HWY_INLINE void LoadVertices(const ScreenMesh& mesh, const std::int32_t* vertex,
                             FaceVec (&out)[4]) {
  const auto at = [&](std::size_t i)
                      HWY_ATTR { return &mesh.packed[static_cast<std::size_t>(vertex[i])].x; };
  LoadQuads(FaceTag(), at, 0, out);
}

// Four pixels.
using QuadIntTag = hn::RebindToSigned<QuadTag>;

HWY_INLINE bool AllBackground(const std::int32_t* faces) {
  const QuadIntTag di;
  return hn::AllTrue(di, hn::Lt(hn::LoadU(di, faces), hn::Zero(di)));
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

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

// Vertices of corner k of faces f, f + 1, ...
struct FaceVertices {
  FaceInt v[3];
};
HWY_INLINE FaceVertices LoadFaceVertices(const ScreenMesh& mesh, std::size_t f, std::size_t count) {
  return {
      {LoadSome(&mesh.v0[f], count), LoadSome(&mesh.v1[f], count), LoadSome(&mesh.v2[f], count)}};
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

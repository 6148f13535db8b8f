// SPDX-License-Identifier: Apache-2.0
// Vector body of bin.h: lanes are faces.
#if defined(TILEGRAD_RASTER_BIN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_BIN_INL_H_
#undef TILEGRAD_RASTER_BIN_INL_H_
#else
#define TILEGRAD_RASTER_BIN_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "raster/bin.h"
#include "raster/face_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Along one axis: tiles [begin, end) that hold a pixel centre j + 0.5, j in [0, size), within
// `margin` of the face; begin >= end if there is none.
HWY_INLINE void AxisTiles(const float* coordinate, const FaceInt v[3], float margin, int size,
                          FaceInt* begin, FaceInt* end) {
  const FaceTag d;
  const FaceIntTag di;
  const auto a = hn::GatherIndex(d, coordinate, v[0]);
  const auto b = hn::GatherIndex(d, coordinate, v[1]);
  const auto c = hn::GatherIndex(d, coordinate, v[2]);
  const auto low = hn::Min(hn::Min(a, b), c), high = hn::Max(hn::Max(a, b), c);
  const auto half = hn::Set(d, 0.5f);
  const auto first = hn::Ceil(hn::Sub(hn::Sub(low, hn::Set(d, margin)), half));
  const auto last = hn::Floor(hn::Sub(hn::Add(high, hn::Set(d, margin)), half));
  const auto clamp = [&](FaceVec x, int from, int to) HWY_ATTR {
    return hn::ConvertTo(di, hn::Min(hn::Max(x, hn::Set(d, static_cast<float>(from))),
                                     hn::Set(d, static_cast<float>(to))));
  };
  *begin = hn::ShiftRight<kTileBits>(clamp(first, 0, size));
  *end = hn::Add(hn::ShiftRight<kTileBits>(clamp(last, -1, size - 1)), hn::Set(di, 1));
  const auto none = hn::Or(
      hn::Gt(first, last),
      hn::Or(hn::Lt(last, hn::Zero(d)), hn::Gt(first, hn::Set(d, static_cast<float>(size - 1)))));
  *end = hn::IfThenZeroElse(hn::RebindMask(di, none), *end);
}

// out[f] for every face; faces with a bit of `reject` get none.
void FaceTiles(const ScreenMesh& mesh, const TileGrid& grid, const BinMargin& margin,
               TileRange* out) {
  const FaceIntTag di;
  const std::size_t lanes = hn::Lanes(di), n = mesh.faces();
  for (std::size_t f = 0; f < n; f += lanes) {
    HWY_ALIGN std::int32_t range[4][kMostFaceLanes];
    const std::size_t count = HWY_MIN(lanes, n - f);
    const FaceVertices vertices = LoadFaceVertices(mesh, f, count);
    FaceInt begin, end;
    AxisTiles(mesh.x.data(), vertices.v, margin.x, grid.width, &begin, &end);
    hn::Store(begin, di, range[0]), hn::Store(end, di, range[1]);
    AxisTiles(mesh.y.data(), vertices.v, margin.y, grid.height, &begin, &end);
    hn::Store(begin, di, range[2]), hn::Store(end, di, range[3]);
    for (std::size_t i = 0; i < count; ++i) {
      const bool out_of_it = (mesh.reject[f + i] & margin.reject) != 0;
      out[f + i] = {static_cast<std::int16_t>(range[0][i]),
                    static_cast<std::int16_t>(out_of_it ? 0 : range[1][i]),
                    static_cast<std::int16_t>(range[2][i]), static_cast<std::int16_t>(range[3][i])};
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

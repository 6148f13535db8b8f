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

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using BinTag = HWY_CAPPED(float, kTileSize);
using BinIntTag = hn::RebindToSigned<BinTag>;
using BinLane = hn::Vec<BinTag>;
using BinIntLane = hn::Vec<BinIntTag>;

// Along one axis: tiles [begin, end) that hold a pixel centre j + 0.5, j in [0, size), within
// `margin` of the face; begin >= end if there is none.
HWY_INLINE void AxisTiles(const float* coordinate, const BinIntLane v[3], float margin, int size,
                          BinIntLane* begin, BinIntLane* end) {
  const BinTag d;
  const BinIntTag di;
  const auto a = hn::GatherIndex(d, coordinate, v[0]);
  const auto b = hn::GatherIndex(d, coordinate, v[1]);
  const auto c = hn::GatherIndex(d, coordinate, v[2]);
  const auto low = hn::Min(hn::Min(a, b), c), high = hn::Max(hn::Max(a, b), c);
  const auto half = hn::Set(d, 0.5f);
  const auto first = hn::Ceil(hn::Sub(hn::Sub(low, hn::Set(d, margin)), half));
  const auto last = hn::Floor(hn::Sub(hn::Add(high, hn::Set(d, margin)), half));
  const auto clamp = [&](BinLane x, int from, int to) HWY_ATTR {
    return hn::ConvertTo(di, hn::Min(hn::Max(x, hn::Set(d, static_cast<float>(from))),
                                     hn::Set(d, static_cast<float>(to))));
  };
  static_assert(kTileSize == 1 << 4);
  *begin = hn::ShiftRight<4>(clamp(first, 0, size));
  *end = hn::Add(hn::ShiftRight<4>(clamp(last, -1, size - 1)), hn::Set(di, 1));
  const auto none = hn::Or(
      hn::Gt(first, last),
      hn::Or(hn::Lt(last, hn::Zero(d)), hn::Gt(first, hn::Set(d, static_cast<float>(size - 1)))));
  *end = hn::IfThenZeroElse(hn::RebindMask(di, none), *end);
}

// The first `count` lanes; the first of them again where there are more.
HWY_INLINE BinIntLane LoadFaces(const std::int32_t* from, std::size_t count) {
  const BinIntTag di;
  if (count >= hn::Lanes(di)) return hn::LoadU(di, from);
  HWY_ALIGN std::int32_t index[kTileSize];
  for (std::size_t i = 0; i < hn::Lanes(di); ++i) index[i] = from[i < count ? i : 0];
  return hn::Load(di, index);
}

// out[f] for every face; faces with a bit of `reject` get none.
void FaceTiles(const ScreenMesh& mesh, const TileGrid& grid, const BinMargin& margin,
               TileRange* out) {
  const BinIntTag di;
  const std::size_t lanes = hn::Lanes(di), n = mesh.faces();
  for (std::size_t f = 0; f < n; f += lanes) {
    HWY_ALIGN std::int32_t range[4][kTileSize];
    const std::size_t count = HWY_MIN(lanes, n - f);
    const std::int32_t* const corners[3] = {&mesh.v0[f], &mesh.v1[f], &mesh.v2[f]};
    BinIntLane v[3], begin, end;
    for (int k = 0; k < 3; ++k) v[k] = LoadFaces(corners[k], count);
    AxisTiles(mesh.x.data(), v, margin.x, grid.width, &begin, &end);
    hn::Store(begin, di, range[0]), hn::Store(end, di, range[1]);
    AxisTiles(mesh.y.data(), v, margin.y, grid.height, &begin, &end);
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

// SPDX-License-Identifier: Apache-2.0
#include "raster/tile_faces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/tile_faces.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/tile_faces-inl.h"

#if HWY_ONCE
namespace tilegrad::raster {
namespace {

HWY_EXPORT(NumberFaces);

}  // namespace

void FindTileFaces(const std::int32_t* pixel_faces, const TileRect& rect, TileFaces* out) {
  HWY_DYNAMIC_DISPATCH(NumberFaces)(pixel_faces, rect, out);
}

}  // namespace tilegrad::raster
#endif

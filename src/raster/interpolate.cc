// SPDX-License-Identifier: Apache-2.0
#include "raster/interpolate.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/interpolate.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/interpolate-inl.h"

#if HWY_ONCE
namespace tilegrad::raster {
namespace {

HWY_EXPORT(Interpolate);

}  // namespace

void TileQuads::Resize(int outputs) {
  groups_ = 1 + outputs / 4;  // group 0 has three
  data_.resize(4 * kTilePixels * static_cast<std::size_t>(3 * groups_ + 1));
}

void InterpolateTile(const InterpolateInput& input, const TileFaces& faces, const TileRect& rect,
                     TileQuads* quads, const InterpolateOutput& out) {
  quads->Resize(InterpolateOutputs(input));
  HWY_DYNAMIC_DISPATCH(Interpolate)(input, faces, rect, quads, out);
}

}  // namespace tilegrad::raster
#endif

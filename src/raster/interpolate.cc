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

HWY_EXPORT(SetUpPlanes);
HWY_EXPORT(Interpolate);
HWY_EXPORT(InterpolateBackward);

}  // namespace

void TilePlanes::Resize(int channels, bool barycentrics) {
  channels_ = channels, outputs_ = channels + (barycentrics ? 2 : 0);
  const auto arrays = static_cast<std::size_t>(channels) + 1;
  data_.resize(kTilePixels * static_cast<std::size_t>(3 * (4 + outputs_) + 4));
  rows_.resize(kTilePixels * 3);
  h_.resize(kTilePixels * arrays);
  moments_.resize(kTilePixels * 3 * arrays);
}

void SetUpTilePlanes(const InterpolateInput& input, const TileFaces& faces, TilePlanes* planes) {
  planes->Resize(input.attributes.channels, input.barycentrics);
  HWY_DYNAMIC_DISPATCH(SetUpPlanes)(input, faces, planes);
}

void TileQuads::Resize(int outputs) {
  groups_ = 1 + outputs / 4;  // group 0 has three
  data_.resize(4 * kTilePixels * static_cast<std::size_t>(3 * groups_ + 1));
}

void InterpolateTile(const InterpolateInput& input, const TileFaces& faces, const TileRect& rect,
                     TileQuads* quads, const InterpolateOutput& out) {
  quads->Resize(InterpolateOutputs(input));
  HWY_DYNAMIC_DISPATCH(Interpolate)(input, faces, rect, quads, out);
}

void InterpolateTileBackward(const InterpolateInput& input, const TileFaces& faces,
                             const TileRect& rect, const PlanarView<const float>& d_out,
                             TilePlanes* planes, std::size_t stride, float* d_faces) {
  HWY_DYNAMIC_DISPATCH(InterpolateBackward)(input, faces, rect, d_out, planes, stride, d_faces);
}

}  // namespace tilegrad::raster
#endif

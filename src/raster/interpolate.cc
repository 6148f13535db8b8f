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

HWY_EXPORT(InterpolateFaces);
HWY_EXPORT(ClearPixels);

}  // namespace

void PlaneQuads::Reserve(int outputs, std::size_t slots) {
  groups_ = 1 + outputs / 4;  // group 0 has three
  slots_ = slots;
  const std::size_t size = 4 * slots * static_cast<std::size_t>(3 * groups_ + 1);
  if (data_.size() < size) data_.resize(size);
}

void Interpolate(const InterpolateInput& input, const FaceRows& rows, const InterpolateOutput& out,
                 InterpolateScratch* scratch) {
  const std::size_t faces = input.mesh->faces();
  scratch->quads.Reserve(InterpolateOutputs(input), SeenFaces::MostSlots(faces, rows.pixels()));
  NumberFaces(rows, faces, &scratch->seen);
  if (scratch->seen.faces() == 0) {
    InterpolateBackground(input, rows, out);
    return;
  }
  HWY_DYNAMIC_DISPATCH(InterpolateFaces)(input, rows, out, scratch);
  ForgetFaces(&scratch->seen);
}

void InterpolateBackground(const InterpolateInput& input, const FaceRows& rows,
                           const InterpolateOutput& out) {
  HWY_DYNAMIC_DISPATCH(ClearPixels)(input, rows, out);
}

}  // namespace tilegrad::raster
#endif

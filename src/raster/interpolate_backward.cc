// SPDX-License-Identifier: Apache-2.0
#include "raster/interpolate_backward.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/interpolate_backward.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/interpolate_backward-inl.h"

#if HWY_ONCE
#include <algorithm>

namespace tilegrad::raster {
namespace {

HWY_EXPORT(NumberFaces);
HWY_EXPORT(SumMoments);
HWY_EXPORT(Finish);

template <class T>
void GrowTo(std::size_t size, T fill, AlignedVector<T>* array) {
  if (array->size() < size) array->resize(size, fill);
}

// To what the band can need, not what it does: which band comes to which worker is not determined,
// and nothing shall be allocated once every size has been seen.
void Reserve(const InterpolateInput& input, const BackwardBand& band, BandSums* sums) {
  const std::size_t faces = input.mesh->faces(), groups = ChannelGroups(input.attributes.channels);
  const std::size_t pixels = static_cast<std::size_t>(band.width) *
                             static_cast<std::size_t>(band.row_end - band.row_begin);
  const std::size_t slots = std::min(faces, pixels) + 2 + kTileSize;
  GrowTo(1 + faces, -1, &sums->slot_of_face);
  sums->slot_of_face[0] = 0;
  GrowTo(slots, 0, &sums->face);
  for (auto* array : {&sums->origin_x, &sums->origin_y, &sums->least_q}) {
    GrowTo(slots, 0.0f, array);
  }
  GrowTo(12 * groups * slots, 0.0f, &sums->moments);
  if (input.mode == Interpolation::kPerspective) GrowTo(12 * groups * slots, 0.0f, &sums->planes);
}

// Slot 0, and those that make the last vector whole, are copies of others.
void PadSlots(BandSums* sums) {
  const auto copy = [&](std::size_t from, std::size_t to) {
    sums->face[to] = sums->face[from];
    sums->origin_x[to] = sums->origin_x[from], sums->origin_y[to] = sums->origin_y[from];
  };
  copy(1, 0);
  for (std::size_t s = sums->count; s < sums->stride(); ++s) copy(1, s);
}

}  // namespace

void SumBand(const InterpolateInput& input, const BackwardBand& band, BandSums* sums) {
  Reserve(input, band, sums);
  HWY_DYNAMIC_DISPATCH(NumberFaces)(band, sums);
  if (sums->faces() == 0) return;
  PadSlots(sums);
  HWY_DYNAMIC_DISPATCH(SumMoments)(input, band, sums);
  for (std::size_t s = 1; s < sums->count; ++s) {
    sums->slot_of_face[static_cast<std::size_t>(1 + sums->face[s])] = -1;
  }
}

void FinishBand(const InterpolateInput& input, const BandSums& sums, const BackwardRequest& request,
                std::span<float> d_faces) {
  HWY_DYNAMIC_DISPATCH(Finish)(input, sums, request, d_faces.data());
}

}  // namespace tilegrad::raster
#endif

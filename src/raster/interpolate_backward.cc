// SPDX-License-Identifier: Apache-2.0
#include "raster/interpolate_backward.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/interpolate_backward.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/interpolate_backward-inl.h"

#if HWY_ONCE
namespace tilegrad::raster {
namespace {

HWY_EXPORT(SumMoments);
HWY_EXPORT(Finish);

// Reserves the most that the band can need, like ReserveSeenFaces.
void ReserveSums(const InterpolateInput& input, const BackwardBand& band, BandSums* sums) {
  const std::size_t groups = ChannelGroups(input.attributes.channels);
  const std::size_t slots = SeenFaces::MostSlots(input.mesh->faces(), band.rows.pixels());
  const auto grow = [](std::size_t size, AlignedVector<float>* array) {
    if (array->size() < size) array->resize(size);
  };
  grow(slots, &sums->least_q);
  grow(12 * groups * slots, &sums->moments);
  if (input.mode == Interpolation::kPerspective) grow(12 * groups * slots, &sums->planes);
}

}  // namespace

void SumBand(const InterpolateInput& input, const BackwardBand& band, BandSums* sums) {
  ReserveSums(input, band, sums);
  NumberFaces(band.rows, input.mesh->faces(), sums);
  if (sums->faces() == 0) return;
  HWY_DYNAMIC_DISPATCH(SumMoments)(input, band, sums);
  ForgetFaces(sums);
}

void FinishBand(const InterpolateInput& input, const BandSums& sums, const BackwardRequest& request,
                std::span<float> d_faces) {
  HWY_DYNAMIC_DISPATCH(Finish)(input, sums, request, d_faces.data());
}

}  // namespace tilegrad::raster
#endif

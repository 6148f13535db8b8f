// SPDX-License-Identifier: Apache-2.0
// The adjoint of interpolate.h, for a band of rows of an image: two passes over its face ids, the
// first to number the faces that are seen, the second to sum moments per face; then one over those
// faces. The formulas stand in interpolate.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/interpolate.h"
#include "raster/seen_faces.h"

namespace tilegrad::raster {

// Rows of an image, all their pixels.
struct BackwardBand {
  FaceRows rows;
  PlanarView<const float> d_out;  // dL/d(attributes), from the band's first pixel on
};

// Channels are summed in groups of three; the fourth number of a group is s.
inline std::size_t ChannelGroups(int channels) {
  return static_cast<std::size_t>(channels + 2) / 3;
}

// What is summed over a band. Slot 0 takes what belongs to no face.
struct BandSums : SeenFaces {
  AlignedVector<float> least_q;  // [slot], and
  AlignedVector<float> planes;   // [group][value, d/dx, d/dy][slot][4] N and Q: if perspective
  AlignedVector<float> moments;  // [group][1, x, y][slot][4]
};

// Which gradients are wanted.
struct BackwardRequest {
  bool geometry;    // d_x, d_y, d_inverse_depth of the corners
  bool attributes;  // d_attribute of the corners
};

// Sums over the band's pixels.
void SumBand(const InterpolateInput& input, const BackwardBand& band, BandSums* sums);

// Number of arrays that FinishBand writes.
inline std::size_t FaceGradientArrays(int channels, const BackwardRequest& request) {
  return (request.geometry ? 3 : 0) + (request.attributes ? 3 * ChannelGroups(channels) : 0);
}

// From sums to gradients of the corners: overwrites FaceGradientArrays arrays [stride][4], one
// after the other, by slot (slot 0 holds nothing of meaning): (d_x, d_y, d_inverse_depth, 0) of
// corners 0, 1, 2 if geometry is wanted; then, for each group, three channels' d_attribute and 0 of
// corners 0, 1, 2 if attributes are wanted.
void FinishBand(const InterpolateInput& input, const BandSums& sums, const BackwardRequest& request,
                std::span<float> d_faces);

}  // namespace tilegrad::raster

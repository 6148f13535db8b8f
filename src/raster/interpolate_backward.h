// SPDX-License-Identifier: Apache-2.0
// The adjoint of interpolate.h, for a band of rows of an image: a first pass over its face ids
// numbers the visible faces, a second sums moments per face; a third runs over those faces.
// interpolate.h has the formulas.
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

// Sums over a band. Slot 0 collects pixels without a face.
struct BandSums : SeenFaces {
  AlignedVector<float> least_q;  // [slot], and
  AlignedVector<float> planes;   // [group][value, d/dx, d/dy][slot][4] N and Q: if perspective
  AlignedVector<float> moments;  // [group][1, x, y][slot][4]
};

// The requested gradients.
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

// Turns sums into gradients of the corners: overwrites FaceGradientArrays arrays [stride][4],
// concatenated, by slot (slot 0 is meaningless): (d_x, d_y, d_inverse_depth, 0) of corners 0, 1, 2
// if geometry is requested; then, for each group, three channels' d_attribute and 0 of corners 0,
// 1, 2 if attributes are requested.
void FinishBand(const InterpolateInput& input, const BandSums& sums, const BackwardRequest& request,
                std::span<float> d_faces);

}  // namespace tilegrad::raster

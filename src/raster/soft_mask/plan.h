// SPDX-License-Identifier: Apache-2.0
// Divides the error budget (docs/numerics.md, "Budget").
#pragma once

#include "raster/soft_mask/soft_mask.h"

namespace tilegrad::raster {

// From this z on the vector code takes A as 0 and skips faces.
inline constexpr int kEndZ = 126;
// A remaining product up to this changes alpha by less than half a unit in the last place of 1.
inline constexpr double kUnseenProduct = 0x1p-26;
// Backward: faces nearer than this to a block are near ones. A <= 1/8 for the others.
inline constexpr double kFarZ = 3;
// The least product in light pixels, or of each of their lanes: A <= 63/64 there for all faces, and
// ten factors of Odds suffice. Smaller ones would cost digits, larger ones make more pixels dark.
inline constexpr double kLightProduct = 1.0 / 64;
// The largest float below it.
inline constexpr float kMostDark = static_cast<float>(kLightProduct) * (1 - 0x1p-24f);
// How many faces of a chunk one lane may get in vectors of `lanes` lanes: those of three lists,
// each padded to whole vectors.
constexpr std::size_t FacesOfLane(std::size_t lanes) {
  return (kChunkFaces + 3 * (lanes - 1)) / lanes;
}
// Bounds the rounding of a lane's product: u per face, and once that of 1 - a (docs/numerics.md,
// "Rounding" 4).
constexpr double LaneRounding(std::size_t lanes) { return lanes < kSoftLanes ? 0x1p-17 : 0x1p-18; }
static_assert(static_cast<double>(FacesOfLane(8) + 1) * 0x1p-24 < LaneRounding(8));
static_assert(static_cast<double>(FacesOfLane(4) + 1) * 0x1p-24 < LaneRounding(4));
// The part of the budget that may be dropped: the rest covers rounding of the lanes' products.
inline constexpr double kUnseenShare = 0.9;

// The backward pass may also drop a face with so little A that 1 - A is 1 in float, as long as the
// sum over those dropped at a pixel is at most kVanishingSum (docs/numerics.md, "Gradients").
inline constexpr double kVanishingInfluence = 0x1p-25, kVanishingSum = 0x1p-17;

// The z beyond which each of `n` faces has A <= share / n, and all together at most `share`.
double DropZ(std::size_t n, double share);

// The product at which a pixel may stop.
double StopProduct(const SoftMaskPlan& plan);

// A pixel's product over all faces but one is at most product / least (of all lanes, and the least
// lane), if neither is too small. True if that is too small to matter for a gradient.
bool IsUnseen(const SoftMaskPlan& plan, double product, double least);

// SoftMaskImages::transmittance of a background pixel if only alpha is known.
float TransmittanceOf(const SoftMaskPlan& plan, float alpha);

// The reach beyond which alpha, and its gradient, may drop faces of nodes with `faces` faces.
SoftReach ReachOf(const SoftMaskPlan& plan, std::size_t faces);
SoftReach GradientReachOf(const SoftMaskPlan& plan, std::size_t faces);

}  // namespace tilegrad::raster

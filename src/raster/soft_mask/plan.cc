// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask/plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tilegrad::raster {

double DropZ(std::size_t n, double share) {
  const double count = static_cast<double>(std::max<std::size_t>(n, 1));
  // A margin for the rounding of the logarithm and of the recorded power.
  const double z = std::log2(count / share) + 0x1p-30;
  return share > 0 ? std::clamp<double>(z, 0.0, kEndZ) : kEndZ;
}

SoftMaskPlan PlanSoftMask(const SoftMaskOptions& options) {
  SoftMaskPlan plan;
  plan.width = options.width;
  plan.height = options.height;
  // Kernels sharper than 1e-15 pixel are not resolved, and would overflow; nor wider ones than
  // 1e37 pixels.
  const double longer = std::max(options.width, options.height);
  const double root =
      std::clamp(std::sqrt(options.delta * std::numbers::ln2), 2e-15 / longer, 1e37 / longer);
  plan.unit_x = 2.0 / options.width / root;
  plan.unit_y = 2.0 / options.height / root;
  const double error = options.max_alpha_error;
  plan.node_error = plan.stop_error = error / 4;
  plan.face_error = error * 3 / 4;
  plan.group_z = DropZ(options.faces, plan.node_error / 2);
  plan.group_influence = std::exp2(-plan.group_z);
  return plan;
}

double StopProduct(const SoftMaskPlan& plan) { return std::max(plan.stop_error, kUnseenProduct); }

bool IsUnseen(const SoftMaskPlan& plan, double product, double least) {
  return product <= kUnseenShare * plan.stop_error * least;
}

float TransmittanceOf(const SoftMaskPlan& plan, float alpha) {
  const double spent = plan.node_error + plan.face_error;
  const float product = 1 - alpha;
  return static_cast<double>(product) < kLightProduct + spent ? kUnknownTransmittance : product;
}

namespace {

SoftReach ReachAt(double z, const SoftMaskPlan& plan) {
  const double pixel = std::hypot(plan.unit_x, plan.unit_y);
  // Covers the rounding of distances ("Rounding" 2), and of z to float.
  const auto with_rounding = [&](double root) {
    return static_cast<float>(root + 0x1p-18 * (root + (kLongEdge + kBlockSize) * pixel));
  };
  const float root = with_rounding(std::sqrt(z));
  const auto in_pixels = [&](double pixels) { return static_cast<float>(root * pixels); };
  return {static_cast<float>(z * (1 + 0x1p-20)),
          root,
          with_rounding(std::sqrt(kFarZ)),
          std::exp2(-z),
          in_pixels(1 / plan.unit_x),
          in_pixels(1 / plan.unit_y),
          in_pixels(std::hypot(1 / plan.unit_x, 1 / plan.unit_y))};
}

}  // namespace

SoftReach ReachOf(const SoftMaskPlan& plan, std::size_t faces) {
  return ReachAt(DropZ(faces, plan.face_error), plan);
}

SoftReach GradientReachOf(const SoftMaskPlan& plan, std::size_t faces) {
  const double own = std::min(plan.stop_error, kVanishingInfluence);
  const double vanishing = std::max(DropZ(1, own), DropZ(faces, kVanishingSum));
  return ReachAt(std::min(DropZ(faces, plan.face_error), vanishing), plan);
}

}  // namespace tilegrad::raster

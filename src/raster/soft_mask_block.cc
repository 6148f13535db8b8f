// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask_block.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::raster {
namespace {

// At this z the vector code takes A as 0 (kDecayEnd).
constexpr double kEndZ = 87;

// Pixels; covers the rounding of BinSoftFaces, which works in float on coordinates up to
// size + margin. Infinite where that overflows.
float Margin(double z, double unit, int size) {
  const double exact = std::sqrt(z) / unit;
  return static_cast<float>(exact + (exact + size) * 0x1p-20);
}

}  // namespace

double DropZ(std::size_t n, double share) {
  const double count = static_cast<double>(std::max<std::size_t>(n, 1));
  return share > 0 ? std::clamp(std::log(count / share), 0.0, kEndZ) : kEndZ;
}

SoftFrame FrameOf(const SoftMaskPlan& plan, const TileRect& tile) {
  return {0.5 * (tile.x0 + tile.x1), 0.5 * (tile.y0 + tile.y1), plan.unit_x, plan.unit_y};
}

SoftPoint ToUnits(const SoftFrame& frame, double x, double y) {
  return {(x - frame.x) * frame.unit_x, (y - frame.y) * frame.unit_y};
}

SoftBox BoxOf(const SoftFrame& frame, const TileRect& pixels, double z) {
  const double half_x = 0.5 * (pixels.x1 - pixels.x0 - 1) * frame.unit_x;
  const double half_y = 0.5 * (pixels.y1 - pixels.y0 - 1) * frame.unit_y;
  const SoftPoint centre =
      ToUnits(frame, 0.5 * (pixels.x0 + pixels.x1), 0.5 * (pixels.y0 + pixels.y1));
  const double reach = std::sqrt(z) + std::hypot(half_x, half_y);
  return {centre.x, centre.y, half_x, half_y, z, reach * reach};
}

void SetUpBlock(const SoftFrame& frame, double z, SoftBlock* block) {
  const auto offset = [](double pixel, double unit) {
    return static_cast<float>((pixel - 0.5 * (kBlockSize - 1)) * unit);
  };
  for (int y = 0; y < kBlockSize; ++y) {
    for (int x = 0; x < kBlockSize; ++x) {
      block->x[PixelOf(x, y)] = offset(x, frame.unit_x);
      block->y[PixelOf(x, y)] = offset(y, frame.unit_y);
    }
  }
  constexpr double kHalfX = 0.5 * (kCellWidth - 1), kHalfY = 0.5 * (kCellHeight - 1);
  for (int y = 0; y < kBlockSize; y += kCellHeight) {
    for (int x = 0; x < kBlockSize; x += kCellWidth) {
      block->cell_x[CellOf(x, y)] = offset(x + kHalfX, frame.unit_x);
      block->cell_y[CellOf(x, y)] = offset(y + kHalfY, frame.unit_y);
    }
  }
  const double radius = 0.5 * (kBlockSize - 1) * std::hypot(frame.unit_x, frame.unit_y);
  const double exact = std::sqrt(z) + std::hypot(kHalfX * frame.unit_x, kHalfY * frame.unit_y);
  const double reach = exact + 0x1p-20 * (exact + radius);  // covers the rounding of z
  block->cell_reach = static_cast<float>(reach * reach);
}

SoftMaskPlan PlanSoftMask(const SoftMaskOptions& options) {
  SoftMaskPlan plan;
  plan.width = options.width, plan.height = options.height, plan.faces = options.faces;
  // A sharper kernel than 1e-15 pixel is not resolved, and would overflow.
  const double sharpest = 2e-15 / std::max(options.width, options.height);
  const double root = std::max(std::sqrt(options.delta), sharpest);
  plan.unit_x = 2.0 / options.width / root, plan.unit_y = 2.0 / options.height / root;
  const double error = options.max_alpha_error;
  plan.bin_error = plan.stop_error = error / 4, plan.cull_error = error / 2;
  plan.bin_z = DropZ(options.faces, plan.bin_error);
  plan.margin_x = Margin(plan.bin_z, plan.unit_x, options.width);
  plan.margin_y = Margin(plan.bin_z, plan.unit_y, options.height);
  return plan;
}

std::size_t CountSoftFaces(const ScreenMesh& mesh) {
  return static_cast<std::size_t>(
      std::count_if(mesh.reject.begin(), mesh.reject.end(),
                    [](std::uint8_t bits) { return (bits & kFaceNotInSoftMask) == 0; }));
}

double BinnedError(const SoftMaskPlan& plan, std::size_t listed) {
  return static_cast<double>(plan.faces - listed) * std::exp(-plan.bin_z);
}

double StopProduct(const SoftMaskPlan& plan) { return std::max(plan.stop_error, kUnseenProduct); }

}  // namespace tilegrad::raster

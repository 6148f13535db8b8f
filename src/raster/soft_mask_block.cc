// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask_block.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::raster {
namespace {

// At this z the vector code takes A as 0 (kDecayEnd).
constexpr double kEndZ = 87;

// z from which on n faces have A <= share / n each, and together no more than `share`.
double DropZ(std::size_t n, double share) {
  const double count = static_cast<double>(std::max<std::size_t>(n, 1));
  return share > 0 ? std::clamp(std::log(count / share), 0.0, kEndZ) : kEndZ;
}

// Pixels; covers the rounding of BinSoftFaces, which works in float on coordinates up to
// size + margin. Infinite where that overflows.
float Margin(double z, double unit, int size) {
  const double exact = std::sqrt(z) / unit;
  return static_cast<float>(exact + (exact + size) * 0x1p-20);
}

struct Point {
  double x, y;
};

SoftEdge MakeEdge(const Point& a, const Point& b) {
  const double ex = b.x - a.x, ey = b.y - a.y;
  const double length = std::sqrt(ex * ex + ey * ey);
  const double tx = length > 0 ? ex / length : 1, ty = length > 0 ? ey / length : 0;
  return {tx, ty, ty * a.x - tx * a.y, -(tx * a.x + ty * a.y), length};
}

SoftFace MakeFace(const Point (&c)[3]) {
  const auto [left, right] = std::minmax({c[0].x, c[1].x, c[2].x});
  const auto [top, bottom] = std::minmax({c[0].y, c[1].y, c[2].y});
  return {
      left, top, right, bottom, {MakeEdge(c[0], c[1]), MakeEdge(c[1], c[2]), MakeEdge(c[2], c[0])}};
}

// Finite, and its square is at most infinite.
float ToFloat(double v) { return static_cast<float>(std::clamp(v, -1e30, 1e30)); }

SoftBlockEdge ShiftEdge(const SoftEdge& e, const Point& p) {
  const double along = e.along + e.tx * p.x + e.ty * p.y;
  return {ToFloat(e.tx),
          ToFloat(e.ty),
          ToFloat(e.side - e.ty * p.x + e.tx * p.y),
          ToFloat(along),
          ToFloat(along - e.length),
          e.length > 0 ? ToFloat(1 / e.length) : 0.0f};
}

// A block's pixel centres: a box around `centre`.
struct Box {
  Point centre, half;
  double radius() const { return std::hypot(half.x, half.y); }
};

Box BoxOf(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect) {
  const double dx = rect.x0 + 0.5 * kBlockSize - 0.5 * (tile.rect.x0 + tile.rect.x1);
  const double dy = rect.y0 + 0.5 * kBlockSize - 0.5 * (tile.rect.y0 + tile.rect.y1);
  constexpr double kHalf = 0.5 * (kBlockSize - 1);
  return {{dx * plan.unit_x, dy * plan.unit_y}, {kHalf * plan.unit_x, kHalf * plan.unit_y}};
}

double Gap(double low, double high, double centre, double half) {
  return std::max({low - centre - half, centre - half - high, 0.0});
}

// Every point of the block is farther than sqrt(z) from the face's boundary.
bool IsFar(const SoftFace& face, const Box& box, double z) {
  const double gx = Gap(face.left, face.right, box.centre.x, box.half.x);
  const double gy = Gap(face.top, face.bottom, box.centre.y, box.half.y);
  if (gx * gx + gy * gy > z) return true;
  double nearest = SquaredDistance(face.edge[0], box.centre.x, box.centre.y);
  for (int k = 1; k < 3; ++k) {
    nearest = std::min(nearest, SquaredDistance(face.edge[k], box.centre.x, box.centre.y));
  }
  const double reach = std::sqrt(z) + box.radius();
  return nearest > reach * reach;
}

}  // namespace

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

void SetUpFaces(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                AlignedVector<SoftFace>* faces) {
  const double cx = 0.5 * (tile.rect.x0 + tile.rect.x1), cy = 0.5 * (tile.rect.y0 + tile.rect.y1);
  faces->resize(tile.faces.size());
  for (std::size_t n = 0; n < tile.faces.size(); ++n) {
    Point corner[3];
    for (int k = 0; k < 3; ++k) {
      const auto v =
          static_cast<std::size_t>(mesh.vertex(static_cast<std::size_t>(tile.faces[n]), k));
      corner[k] = {(static_cast<double>(mesh.x[v]) - cx) * plan.unit_x,
                   (static_cast<double>(mesh.y[v]) - cy) * plan.unit_y};
    }
    (*faces)[n] = MakeFace(corner);
  }
}

double GatherBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect,
                   SoftMaskScratch* scratch, SoftBlock* block) {
  const Box box = BoxOf(plan, tile, rect);
  const std::size_t listed = scratch->faces.size();
  const double z = DropZ(listed, plan.cull_error);
  scratch->members.clear();
  for (std::size_t n = 0; n < listed; ++n) {
    const SoftFace& face = scratch->faces[n];
    if (IsFar(face, box, z)) continue;
    scratch->members.push_back(
        {{ShiftEdge(face.edge[0], box.centre), ShiftEdge(face.edge[1], box.centre),
          ShiftEdge(face.edge[2], box.centre)},
         static_cast<std::int32_t>(n)});
  }
  for (int i = 0; i < kBlockSize; ++i) {
    const double offset = i - 0.5 * (kBlockSize - 1);
    block->x[i] = static_cast<float>(offset * plan.unit_x);
    block->y[i] = static_cast<float>(offset * plan.unit_y);
  }
  block->members = scratch->members.data(), block->count = scratch->members.size();
  return static_cast<double>(listed - block->count) * std::exp(-z);
}

}  // namespace tilegrad::raster

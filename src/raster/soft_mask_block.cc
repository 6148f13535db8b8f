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
  const double inverse = length > 0 ? 1 / length : 0;
  const double tx = length > 0 ? ex * inverse : 1, ty = ey * inverse;
  return {tx, ty, ty * a.x - tx * a.y, -(tx * a.x + ty * a.y), length, inverse};
}

void SetBox(const Point (&c)[3], SoftFace* face) {
  face->left = std::min({c[0].x, c[1].x, c[2].x}), face->right = std::max({c[0].x, c[1].x, c[2].x});
  face->top = std::min({c[0].y, c[1].y, c[2].y}), face->bottom = std::max({c[0].y, c[1].y, c[2].y});
}

void SetEdges(const Point (&c)[3], SoftFace* face) {
  for (int k = 0; k < 3; ++k) face->edge[k] = MakeEdge(c[k], c[k == 2 ? 0 : k + 1]);
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
          ToFloat(e.inverse_length)};
}

// Pixel centres in a box around `centre`, and z from which on a face is far from them.
struct Box {
  Point centre, half;
  double z, reach;  // reach: sqrt(z) + the radius of the box, squared
};

// The centre of the tile is the origin.
Point ToUnits(const SoftMaskPlan& plan, const SoftMaskTile& tile, double x, double y) {
  return {(x - 0.5 * (tile.rect.x0 + tile.rect.x1)) * plan.unit_x,
          (y - 0.5 * (tile.rect.y0 + tile.rect.y1)) * plan.unit_y};
}

Box BoxOf(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& pixels, double z) {
  const Point half{0.5 * (pixels.x1 - pixels.x0 - 1) * plan.unit_x,
                   0.5 * (pixels.y1 - pixels.y0 - 1) * plan.unit_y};
  const double reach = std::sqrt(z) + std::hypot(half.x, half.y);
  return {ToUnits(plan, tile, 0.5 * (pixels.x0 + pixels.x1), 0.5 * (pixels.y0 + pixels.y1)), half,
          z, reach * reach};
}

double Gap(double low, double high, double centre, double half) {
  return std::max({low - centre - half, centre - half - high, 0.0});
}

// Every point of the box is farther than sqrt(z) from the face's box.
bool IsBoxFar(const SoftFace& face, const Box& box) {
  const double gx = Gap(face.left, face.right, box.centre.x, box.half.x);
  const double gy = Gap(face.top, face.bottom, box.centre.y, box.half.y);
  return gx * gx + gy * gy > box.z;
}

// The same for the face's boundary.
bool IsBoundaryFar(const SoftFace& face, const Box& box) {
  double nearest = SquaredDistance(face.edge[0], box.centre.x, box.centre.y);
  for (int k = 1; k < 3; ++k) {
    nearest = std::min(nearest, SquaredDistance(face.edge[k], box.centre.x, box.centre.y));
  }
  return nearest > box.reach;
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
                const TileRect& background, AlignedVector<SoftFace>* faces) {
  const Box box = BoxOf(plan, tile, background, DropZ(tile.faces.size(), plan.cull_error));
  faces->resize(tile.faces.size());
  for (std::size_t n = 0; n < tile.faces.size(); ++n) {
    SoftFace& face = (*faces)[n];
    Point corner[3];
    for (int k = 0; k < 3; ++k) {
      const auto v =
          static_cast<std::size_t>(mesh.vertex(static_cast<std::size_t>(tile.faces[n]), k));
      corner[k] =
          ToUnits(plan, tile, static_cast<double>(mesh.x[v]), static_cast<double>(mesh.y[v]));
    }
    SetBox(corner, &face);
    face.far = IsBoxFar(face, box);
    if (!face.far) SetEdges(corner, &face);
  }
}

double GatherBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const BlockPixels& pixels,
                   SoftMaskScratch* scratch, SoftBlock* block) {
  const std::size_t listed = scratch->faces.size();
  const double z = DropZ(listed, plan.cull_error);
  const Box box = BoxOf(plan, tile, pixels.background, z);
  constexpr double kMiddle = 0.5 * (kBlockSize - 1);
  const Point origin =
      ToUnits(plan, tile, pixels.rect.x0 + kMiddle + 0.5, pixels.rect.y0 + kMiddle + 0.5);
  scratch->members.clear();
  for (std::size_t n = 0; n < listed; ++n) {
    const SoftFace& face = scratch->faces[n];
    if (face.far || IsBoxFar(face, box) || IsBoundaryFar(face, box)) continue;
    scratch->members.push_back({{ShiftEdge(face.edge[0], origin), ShiftEdge(face.edge[1], origin),
                                 ShiftEdge(face.edge[2], origin)},
                                static_cast<std::int32_t>(n)});
  }
  for (int i = 0; i < kBlockSize; ++i) {
    block->x[i] = static_cast<float>((i - kMiddle) * plan.unit_x);
    block->y[i] = static_cast<float>((i - kMiddle) * plan.unit_y);
  }
  block->members = scratch->members.data(), block->count = scratch->members.size();
  return static_cast<double>(listed - block->count) * std::exp(-z);
}

}  // namespace tilegrad::raster

// SPDX-License-Identifier: Apache-2.0
#include "raster/visibility.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/visibility.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/visibility-inl.h"

#if HWY_ONCE
#include <algorithm>

#include "raster/conventions.h"

namespace tilegrad::raster {
namespace {

HWY_EXPORT(DrawFaces);

// Pixels of [origin, end) whose centre lies in [low, high] (subpixels), counted from origin.
void CentreRange(std::int64_t low, std::int64_t high, int origin, int end, int* first, int* last) {
  constexpr std::int64_t kHalf = kSubpixels / 2;
  const std::int64_t from = (low - kHalf + kSubpixels - 1) >> kSubpixelBits;
  const std::int64_t to = ((high - kHalf) >> kSubpixelBits) + 1;
  *first = static_cast<int>(std::clamp<std::int64_t>(from, origin, end) - origin);
  *last = static_cast<int>(std::clamp<std::int64_t>(to, origin, end) - origin);
}

void SetUpEdges(const SnappedFace& shape, const PixelRect& rect, TileFaceSetup* out) {
  constexpr std::int64_t kFar = std::int64_t{1} << 30;  // 15 steps in x and y stay below 2^30
  for (int k = 0; k < 3; ++k) {
    const int n = k == 2 ? 0 : k + 1;
    const std::int64_t exact =
        shape.EdgeAt<std::int64_t>(k, CentreSubpixel(rect.x0), CentreSubpixel(rect.y0));
    out->edge[k] = static_cast<std::int32_t>(std::clamp(exact >> kSubpixelBits, -kFar, kFar));
    out->step_x[k] = static_cast<std::int32_t>(shape.y[k] - shape.y[n]);
    out->step_y[k] = static_cast<std::int32_t>(shape.x[n] - shape.x[k]);
  }
}

}  // namespace

bool SetUpTileFace(const SnappedFace& shape, const PixelRect& rect, TileFaceSetup* out) {
  const auto [left, right] = std::minmax({shape.x[0], shape.x[1], shape.x[2]});
  const auto [top, bottom] = std::minmax({shape.y[0], shape.y[1], shape.y[2]});
  CentreRange(left, right, rect.x0, rect.x1, &out->column_begin, &out->column_end);
  CentreRange(top, bottom, rect.y0, rect.y1, &out->row_begin, &out->row_end);
  if (out->column_begin >= out->column_end || out->row_begin >= out->row_end) return false;
  out->guarded = shape.guarded();
  if (out->guarded) SetUpEdges(shape, rect, out);
  return true;
}

namespace {

void DrawBin(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
             const float* behind, VisibilityBin* out) {
  const int pixels = (rect.y1 - rect.y0) * kBinSize;
  std::fill(out->face, out->face + pixels, kNoFace);
  std::fill(out->inverse_depth, out->inverse_depth + pixels, 0.0f);
  if (!list.indices.empty()) HWY_DYNAMIC_DISPATCH(DrawFaces)(mesh, list, rect, behind, out);
  // If the bin is narrower, vectors reach beyond the image; clears those columns.
  for (int i = 0; i < rect.y1 - rect.y0 && rect.x1 - rect.x0 < kBinSize; ++i) {
    const int from = i * kBinSize + rect.x1 - rect.x0, to = (i + 1) * kBinSize;
    std::fill(out->face + from, out->face + to, kNoFace);
    std::fill(out->inverse_depth + from, out->inverse_depth + to, 0.0f);
  }
}

}  // namespace

void ComputeVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                       VisibilityBin* out) {
  DrawBin(mesh, list, rect, nullptr, out);
}

void PeelVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                    const float* behind, VisibilityBin* out) {
  DrawBin(mesh, list, rect, behind, out);
}

}  // namespace tilegrad::raster
#endif

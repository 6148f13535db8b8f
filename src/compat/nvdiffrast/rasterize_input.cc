// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/rasterize_input.h"

#include <cmath>

#include "base/error.h"
#include "raster/conventions.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

template <class T>
Status CheckFinite(const VertexRows<T>& positions) {
  for (std::size_t i = 0; i < positions.values.size(); ++i) {
    if (std::isfinite(positions.values[i])) continue;
    return InvalidArgument("position {} of vertex {} is {}", i % 4, i / 4, positions.values[i]);
  }
  return {};
}

Status CheckRanges(std::span<const std::int32_t> ranges, std::size_t faces) {
  for (std::size_t n = 0; n < ranges.size() / 2; ++n) {
    const std::int64_t first = ranges[2 * n], count = ranges[2 * n + 1];
    if (first >= 0 && count >= 0 && first + count <= static_cast<std::int64_t>(faces)) continue;
    return InvalidArgument("range {} is {} faces from {} on, but there are {} faces", n, count,
                           first, faces);
  }
  return {};
}

}  // namespace

template <class T>
Status CheckInput(const RasterizeInput<T>& input) {
  const std::size_t faces = input.faces.size() / 3;
  if (faces > kMostFaces) {
    return InvalidArgument("{} faces; float holds the ids of at most {}", faces, kMostFaces);
  }
  const PixelGrid& grid = input.grid;
  if (grid.width < 1 || grid.height < 1 || grid.width > raster::kMaxImageSize ||
      grid.height > raster::kMaxImageSize) {
    return InvalidArgument("images are {} x {} pixels, but must be 1 to {} high and wide",
                           grid.height, grid.width, raster::kMaxImageSize);
  }
  TILEGRAD_TRY(CheckRanges(input.ranges, faces));
  TILEGRAD_TRY(CheckFaces(input.faces, input.positions.vertices));
  return CheckFinite(input.positions);
}

template Status CheckInput(const RasterizeInput<float>&);
template Status CheckInput(const RasterizeInput<double>&);

}  // namespace tilegrad::compat::nvdiffrast

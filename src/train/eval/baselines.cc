// SPDX-License-Identifier: Apache-2.0
#include "train/eval/baselines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tilegrad::train {
namespace {

constexpr std::size_t kThumbnailSide = kThumbnail,
                      kThumbnailBytes = 4 * kThumbnailSide * kThumbnailSide;

// Adds up to 1024 squares of differences of bytes, which fit in 32 bits.
std::uint32_t ThumbnailDistance(const std::uint8_t* a, const std::uint8_t* b) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < kThumbnailBytes; ++i) {
    const int difference = int{a[i]} - int{b[i]};
    sum += static_cast<std::uint32_t>(difference * difference);
  }
  return sum;
}

constexpr std::size_t kLevels = 256;
using Histogram = std::array<std::size_t, kLevels + 1>;

// For each voxel the share of grids that have it, in units of 1 / kLevels, rounded down.
std::vector<std::uint16_t> Shares(std::span<const std::vector<std::uint8_t>> grids) {
  std::vector<std::size_t> count(grids.front().size(), 0);
  for (const auto& grid : grids) {
    for (std::size_t i = 0; i < count.size(); ++i) count[i] += grid[i];
  }
  std::vector<std::uint16_t> shares(count.size());
  for (std::size_t i = 0; i < count.size(); ++i)
    shares[i] = static_cast<std::uint16_t>(count[i] * kLevels / grids.size());
  return shares;
}

// How many entries are at level k or above, for each k.
void SumFromAbove(Histogram* histogram) {
  for (std::size_t k = kLevels; k-- > 0;) (*histogram)[k] += (*histogram)[k + 1];
}

// Adds a grid's IoU with the shape {share >= k} for every level k at once.
void AddIous(const std::vector<std::uint8_t>& grid, std::span<const std::uint16_t> shares,
             const Histogram& shape_size, std::array<double, kLevels + 1>* sums) {
  Histogram both{};
  for (std::size_t i = 0; i < grid.size(); ++i) both[shares[i]] += grid[i];
  SumFromAbove(&both);
  const std::size_t solid = both[0];
  for (std::size_t k = 0; k <= kLevels; ++k) {
    const std::size_t either = solid + shape_size[k] - both[k];
    (*sums)[k] += either == 0 ? 1.0 : static_cast<double>(both[k]) / static_cast<double>(either);
  }
}

}  // namespace

std::vector<std::uint8_t> Thumbnail(std::span<const std::uint8_t> image, int size) {
  const auto side = static_cast<std::size_t>(size);
  std::vector<std::uint8_t> out(kThumbnailBytes);
  const auto begin = [&](std::size_t i) { return i * side / kThumbnailSide; };
  const auto end = [&](std::size_t i) { return std::max(begin(i + 1), begin(i) + 1); };
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t y = 0; y < kThumbnailSide; ++y) {
      for (std::size_t x = 0; x < kThumbnailSide; ++x) {
        std::size_t sum = 0, count = 0;
        for (std::size_t j = begin(y); j < end(y); ++j) {
          for (std::size_t i = begin(x); i < end(x); ++i, ++count)
            sum += image[(c * side + j) * side + i];
        }
        out[(c * kThumbnailSide + y) * kThumbnailSide + x] =
            static_cast<std::uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return out;
}

void ImageIndex::Add(std::span<const std::uint8_t> images, int views, int size) {
  const std::size_t image = images.size() / static_cast<std::size_t>(views);
  for (int v = 0; v < views; ++v) {
    const auto small = Thumbnail(images.subspan(static_cast<std::size_t>(v) * image, image), size);
    thumbnails_.insert(thumbnails_.end(), small.begin(), small.end());
    entries_.push_back({models_, v});
  }
  ++models_;
}

ImageIndex::Match ImageIndex::Nearest(std::span<const std::uint8_t> image, int size) const {
  const auto small = Thumbnail(image, size);
  std::uint32_t best = std::numeric_limits<std::uint32_t>::max();
  std::size_t at = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const std::uint32_t distance =
        ThumbnailDistance(small.data(), &thumbnails_[i * kThumbnailBytes]);
    if (distance < best) {
      best = distance;
      at = i;
    }
  }
  return {entries_[at].model, entries_[at].view, std::sqrt(best / double{kThumbnailBytes}) / 255};
}

SingleShape BestSingleShape(std::span<const std::vector<std::uint8_t>> grids) {
  const auto shares = Shares(grids);
  Histogram shape_size{};
  for (const auto share : shares) ++shape_size[share];
  SumFromAbove(&shape_size);
  std::array<double, kLevels + 1> sums{};
  for (const auto& grid : grids) AddIous(grid, shares, shape_size, &sums);
  // Level 0 would be the whole cube, whatever the grids hold.
  const auto best = std::max_element(sums.begin() + 1, sums.end());
  const auto level = static_cast<std::size_t>(best - sums.begin());
  SingleShape shape;
  shape.threshold = static_cast<double>(level) / kLevels;
  shape.mean_iou = *best / static_cast<double>(grids.size());
  for (const auto share : shares) shape.occupancy.push_back(share >= level);
  return shape;
}

Mesh VoxelSurface(std::span<const std::uint8_t> occupancy, int n) {
  const auto solid = [&](std::array<int, 3> p) {
    for (int c : p) {
      if (c < 0 || c >= n) return false;
    }
    return occupancy[static_cast<std::size_t>((p[0] * n + p[1]) * n + p[2])] != 0;
  };
  Mesh mesh;
  // One side of a voxel: a square across `axis`, seen from outside.
  const auto add_side = [&](std::array<int, 3> at, std::size_t axis, int side) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto first = static_cast<std::int32_t>(mesh.positions.size());
    at[axis] += side;
    for (const auto& [du, dv] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      auto corner = at;
      corner[u] += du;
      corner[v] += dv;
      mesh.positions.emplace_back(corner[0], corner[1], corner[2]);
    }
    const std::int32_t b = side == 1 ? 1 : 3, d = side == 1 ? 3 : 1;
    mesh.faces.push_back({first, first + b, first + 2});
    mesh.faces.push_back({first, first + 2, first + d});
  };
  for (int x = 0; x < n; ++x) {
    for (int y = 0; y < n; ++y) {
      for (int z = 0; z < n; ++z) {
        if (!solid({x, y, z})) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          for (int side : {0, 1}) {
            std::array<int, 3> next = {x, y, z};
            next[axis] += 2 * side - 1;
            if (!solid(next)) add_side({x, y, z}, axis, side);
          }
        }
      }
    }
  }
  return mesh;
}

}  // namespace tilegrad::train

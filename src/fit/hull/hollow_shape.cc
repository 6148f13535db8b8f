// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/hollow_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "base/parallel.h"

namespace tilegrad::train {
namespace {

// A line of the grid: every `stride`-th number from `first`.
struct Line {
  std::size_t first, stride;
  int count;
};

// The lower envelope of parabolas, each with its vertex at a cell of the line.
class Envelope {
 public:
  explicit Envelope(int most) : heights_(Size(most)), vertices_(Size(most)), from_(Size(most)) {}

  // Squared distances along one more axis. The line's ends have an empty cell beyond them.
  void Lower(const Line& line, std::vector<float>* squares) {
    Build(line, *squares);
    std::size_t k = 0;
    for (int i = 0; i < line.count; ++i) {
      const auto x = static_cast<float>(i + 1);
      while (k + 1 < count_ && from_[k + 1] <= x) ++k;
      const float d = x - vertices_[k];
      (*squares)[line.first + static_cast<std::size_t>(i) * line.stride] = d * d + heights_[k];
    }
  }

 private:
  static std::size_t Size(int most) { return static_cast<std::size_t>(most) + 2; }

  void Build(const Line& line, const std::vector<float>& squares) {
    count_ = 0;
    Push(0, 0);
    for (int i = 0; i < line.count; ++i)
      Push(static_cast<float>(i + 1),
           squares[line.first + static_cast<std::size_t>(i) * line.stride]);
    Push(static_cast<float>(line.count + 1), 0);
  }

  void Push(float vertex, float height) {
    while (count_ > 0 && Crossing(vertex, height) <= from_[count_ - 1]) --count_;
    from_[count_] = count_ > 0 ? Crossing(vertex, height) : -HUGE_VALF;
    vertices_[count_] = vertex;
    heights_[count_] = height;
    ++count_;
  }

  // Where the new parabola goes below the last one.
  float Crossing(float vertex, float height) const {
    const float v = vertices_[count_ - 1], h = heights_[count_ - 1];
    return (height + vertex * vertex - h - v * v) / (2 * (vertex - v));
  }

  std::vector<float> heights_, vertices_, from_;
  std::size_t count_ = 0;
};

std::size_t CountOf(const std::array<int, 3>& size, std::size_t axis) {
  return static_cast<std::size_t>(size[axis]);
}

constexpr std::size_t kMostRims = 3;
constexpr int kRimWindow = 4;       // layers over which a lid that is not level spreads
constexpr int kRimsApart = 6;       // layers
constexpr float kLeastLid = 0.02f;  // area, as a share of the grid's section
constexpr int kSectionBelow = 2;    // layers from the rim down to the section that goes on above

// The number of cells of each layer above which the hull ends.
std::vector<int> EndsByLayer(const ScalarGrid& hull) {
  std::vector<int> ends(static_cast<std::size_t>(hull.size[1]), 0);
  for (int i = 0; i < hull.size[0]; ++i)
    for (int j = 0; j + 1 < hull.size[1]; ++j)
      for (int k = 0; k < hull.size[2]; ++k)
        ends[static_cast<std::size_t>(j)] +=
            hull.values[hull.At(i, j, k)] > 0 && !(hull.values[hull.At(i, j + 1, k)] > 0);
  return ends;
}

// Means around each layer, the nearer the more.
std::vector<float> Smoothed(const std::vector<int>& ends) {
  std::vector<float> out(ends.size(), 0);
  const int count = static_cast<int>(ends.size());
  for (int j = 0; j < count; ++j)
    for (int i = std::max(0, j - kRimWindow); i <= std::min(j + kRimWindow, count - 1); ++i)
      out[static_cast<std::size_t>(j)] +=
          (1 - static_cast<float>(std::abs(i - j)) / (kRimWindow + 1)) *
          static_cast<float>(ends[static_cast<std::size_t>(i)]);
  return out;
}

}  // namespace

Footprint AllColumns(const ScalarGrid& hull) {
  return Footprint(static_cast<std::size_t>(hull.size[0]) * static_cast<std::size_t>(hull.size[2]),
                   1);
}

std::vector<int> RimsOf(const ScalarGrid& hull) {
  std::vector<float> lids = Smoothed(EndsByLayer(hull));
  const float least = kLeastLid * static_cast<float>(hull.size[0] * hull.size[2]);
  std::vector<int> rims;
  while (rims.size() < kMostRims) {
    const auto largest = std::ranges::max_element(lids);
    if (!(*largest >= least)) break;
    const auto layer = static_cast<int>(largest - lids.begin());
    rims.push_back(layer);
    for (int j = layer - kRimsApart; j <= layer + kRimsApart; ++j)
      if (j >= 0 && j < hull.size[1]) lids[static_cast<std::size_t>(j)] = 0;
  }
  return rims;
}

HollowRim::HollowRim(const ScalarGrid& hull, int layer, const Footprint& footprint,
                     const Workers& workers)
    : hull_(&hull), layer_(layer), bottom_(layer) {
  std::vector<std::uint8_t> full(hull.values.size(), 0);
  const int below = std::max(0, layer - kSectionBelow);
  for (int i = 0; i < hull.size[0]; ++i) {
    for (int k = 0; k < hull.size[2]; ++k) {
      if (!footprint[static_cast<std::size_t>(i * hull.size[2] + k)]) continue;
      const bool goes_on = hull.values[hull.At(i, below, k)] > 0;
      for (int j = 0; j < hull.size[1]; ++j) {
        const std::size_t at = hull.At(i, j, k);
        full[at] = j > below ? goes_on : hull.values[at] > 0;
        if (full[at]) bottom_ = std::min(bottom_, j);
      }
    }
  }
  distance_ = DistanceToEmpty(full, hull.size, workers);
}

ScalarGrid HollowRim::Hollow(const HollowShape& shape) const {
  constexpr float kHalf = 0.5f;  // from a cell's centre to its side
  ScalarGrid out{hull_->size, hull_->low, hull_->cell, std::vector<float>(distance_.size())};
  const auto bottom = static_cast<float>(bottom_), rim = static_cast<float>(layer_);
  const float floor = shape.floor > 0 ? bottom + shape.floor * (rim - bottom) : -HUGE_VALF;
  for (int j = 0; j < out.size[1]; ++j) {
    const auto height = static_cast<float>(j);
    const float wall = shape.wall + shape.taper * std::max(0.0f, rim - height) + kHalf;
    const float level = std::min(height - floor, rim + shape.reach + kHalf - height);
    for (int i = 0; i < out.size[0]; ++i) {
      for (int k = 0; k < out.size[2]; ++k) {
        const std::size_t at = out.At(i, j, k);
        out.values[at] = out.cell * std::min(distance_[at] - wall, level);
      }
    }
  }
  return out;
}

std::vector<float> DistanceToEmpty(const std::vector<std::uint8_t>& full,
                                   const std::array<int, 3>& size, const Workers& workers) {
  constexpr float kFar = 1e9f;  // squared; whole numbers above 2^24 lose digits, the far ones only
  std::vector<float> squares(full.size());
  std::ranges::transform(full, squares.begin(), [](std::uint8_t f) { return f ? kFar : 0.0f; });
  const std::array<std::size_t, 3> strides = {CountOf(size, 1) * CountOf(size, 2), CountOf(size, 2),
                                              1};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    workers.For(CountOf(size, u), [&](std::size_t i, std::size_t) {
      Envelope envelope(size[axis]);
      for (std::size_t j = 0; j < CountOf(size, v); ++j)
        envelope.Lower({i * strides[u] + j * strides[v], strides[axis], size[axis]}, &squares);
    });
  }
  for (float& s : squares) s = std::sqrt(s);
  return squares;
}

}  // namespace tilegrad::train

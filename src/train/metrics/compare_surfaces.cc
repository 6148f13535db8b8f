// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>

#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

// A k-d tree in place: the median of each range is its node, what is left and right of it its
// subtrees (Bentley: Multidimensional binary search trees, 1975). Split along the longest side.
class NearestPoint {
 public:
  explicit NearestPoint(std::span<const glm::vec3> points)
      : points_(points.begin(), points.end()), axes_(points.size(), 0) {
    Build(0, points_.size());
  }

  double Distance(const glm::dvec3& query) const {
    double best = std::numeric_limits<double>::infinity();
    Search(0, points_.size(), query, &best);
    return std::sqrt(best);
  }

 private:
  void Build(std::size_t begin, std::size_t end) {
    if (end - begin < 2) return;
    glm::vec3 low = points_[begin], high = low;
    for (std::size_t i = begin; i < end; ++i) {
      low = glm::min(low, points_[i]), high = glm::max(high, points_[i]);
    }
    const glm::vec3 size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) { return points_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end),
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    axes_[middle] = static_cast<std::uint8_t>(axis);
    Build(begin, middle);
    Build(middle + 1, end);
  }

  void Search(std::size_t begin, std::size_t end, const glm::dvec3& query, double* best) const {
    if (begin == end) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const glm::dvec3 offset = query - glm::dvec3(points_[middle]);
    *best = std::min(*best, offset.x * offset.x + offset.y * offset.y + offset.z * offset.z);
    const double across = offset[axes_[middle]];
    const bool left_first = across < 0;
    for (const bool left : {left_first, !left_first}) {
      if (left != left_first && across * across >= *best) continue;
      left ? Search(begin, middle, query, best) : Search(middle + 1, end, query, best);
    }
  }

  std::vector<glm::vec3> points_;
  std::vector<std::uint8_t> axes_;
};

struct OneWay {
  double mean = 0, share = 0;  // of the distances; within the threshold
};

OneWay Measure(std::span<const glm::vec3> from, const NearestPoint& to, double threshold) {
  OneWay out;
  for (const glm::vec3& point : from) {
    const double distance = to.Distance(glm::dvec3(point));
    out.mean += distance;
    out.share += distance <= threshold;
  }
  const double n = static_cast<double>(from.size());
  return {out.mean / n, out.share / n};
}

}  // namespace

SurfaceScore CompareSurfaces(std::span<const glm::vec3> predicted, std::span<const glm::vec3> truth,
                             double threshold) {
  if (predicted.empty() || truth.empty()) return {};
  const OneWay forth = Measure(predicted, NearestPoint(truth), threshold);
  const OneWay back = Measure(truth, NearestPoint(predicted), threshold);
  const double sum = forth.share + back.share;
  return {.chamfer = 0.5 * (forth.mean + back.mean),
          .precision = forth.share,
          .recall = back.share,
          .f_score = sum > 0 ? 2 * forth.share * back.share / sum : 0};
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/nearest_point.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace tilegrad::train {

NearestPoint::NearestPoint(std::span<const glm::dvec3> points) {
  nodes_.reserve(points.size());
  for (const glm::dvec3& p : points) {
    nodes_.push_back({p, static_cast<std::int32_t>(nodes_.size()), 0});
  }
  Build(0, nodes_.size());
}

NearestPoint::NearestPoint(std::span<const glm::vec3> points)
    : NearestPoint(std::vector<glm::dvec3>(points.begin(), points.end())) {}

void NearestPoint::Build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  glm::dvec3 low = nodes_[begin].at, high = low;
  for (std::size_t i = begin; i < end; ++i) {
    low = glm::min(low, nodes_[i].at);
    high = glm::max(high, nodes_[i].at);
  }
  const glm::dvec3 size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end),
                   [axis](const Node& a, const Node& b) { return a.at[axis] < b.at[axis]; });
  nodes_[middle].axis = axis;
  Build(begin, middle);
  Build(middle + 1, end);
}

NearestPoint::Found NearestPoint::Find(const glm::dvec3& query) const {
  Found best;
  Search(0, nodes_.size(), query, &best);
  return best;
}

void NearestPoint::Search(std::size_t begin, std::size_t end, const glm::dvec3& query,
                          Found* best) const {
  if (begin == end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Node& node = nodes_[middle];
  const glm::dvec3 offset = query - node.at;
  const double squared = glm::dot(offset, offset);
  if (squared < best->squared || (squared == best->squared && node.index < best->index)) {
    *best = {node.index, squared};
  }
  const double across = offset[node.axis];
  const bool left_first = across < 0;
  for (const bool left : {left_first, !left_first}) {
    if (left != left_first && across * across > best->squared) continue;
    left ? Search(begin, middle, query, best) : Search(middle + 1, end, query, best);
  }
}

}  // namespace tilegrad::train

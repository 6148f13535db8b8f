// SPDX-License-Identifier: Apache-2.0
// The nearest of a set of points, by a k-d tree in place: the median of each range is its node,
// what is left and right of it its subtrees (Bentley: Multidimensional binary search trees, 1975).
// Split along the longest side.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

namespace tilegrad::train {

class NearestPoint {
 public:
  struct Found {
    std::int32_t index = -1;  // of equally near ones the first; -1 if there is no point
    double squared = std::numeric_limits<double>::infinity();  // distance
  };

  // Coordinates must be finite, and their differences' squares, too.
  explicit NearestPoint(std::span<const glm::dvec3> points);
  explicit NearestPoint(std::span<const glm::vec3> points);

  Found Find(const glm::dvec3& query) const;

 private:
  struct Node {
    glm::dvec3 at;
    std::int32_t index;
    std::int32_t axis;
  };
  void Build(std::size_t begin, std::size_t end);
  void Search(std::size_t begin, std::size_t end, const glm::dvec3& query, Found* best) const;

  std::vector<Node> nodes_;
};

}  // namespace tilegrad::train

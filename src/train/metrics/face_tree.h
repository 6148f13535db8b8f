// SPDX-License-Identifier: Apache-2.0
// Triangles in a hierarchy of boxes: the nearest one to a point, and whether they enclose it.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

namespace tilegrad::train {

using Triangle = std::array<glm::dvec3, 3>;

class FaceTree {
 public:
  struct Nearest {
    std::int32_t face = -1;           // the first of ties; -1 if there is no face
    std::array<double, 3> weights{};  // barycentric, of the nearest point; 0 where on an edge
    double squared = std::numeric_limits<double>::infinity();  // distance
  };

  // Coordinates and the squares of their differences must be finite. Faces without area count as
  // edges or points.
  explicit FaceTree(std::span<const Triangle> faces);

  Nearest Find(const glm::dvec3& query) const;

  // Whether the ray from `query` along +x meets the faces an odd number of times. An edge that two
  // faces share counts for exactly one of them, so that closed surfaces have no cracks.
  bool Encloses(const glm::dvec3& query) const;

 private:
  struct Node {  // the left child follows its parent
    glm::dvec3 low, high;
    std::size_t begin, end;  // of order_
    std::size_t right;       // 0: a leaf
  };
  std::size_t Build(std::size_t begin, std::size_t end);
  void SplitAtMedian(std::size_t begin, std::size_t middle, std::size_t end);
  void Search(std::size_t at, const glm::dvec3& query, Nearest* best) const;

  std::vector<Triangle> faces_;
  std::vector<std::size_t> order_;  // faces in the order of the leaves
  std::vector<Node> nodes_;
};

// The nearest of a set of points, by a k-d tree in place: the median of each range is its node, the
// halves left and right of it are its subtrees (Bentley: Multidimensional binary search trees,
// 1975). Split along the longest side.

class NearestPoint {
 public:
  struct Found {
    std::int32_t index = -1;  // the first of ties; -1 if there is no point
    double squared = std::numeric_limits<double>::infinity();  // distance
  };

  // Coordinates and the squares of their differences must be finite.
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

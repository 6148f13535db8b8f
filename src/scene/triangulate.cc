// SPDX-License-Identifier: Apache-2.0
#include "scene/triangulate.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

namespace tilegrad {
namespace {

constexpr std::size_t kMaxEarCorners = 256;

// Newell's method: the sum over all sides, which is robust for polygons that are not quite planar.
glm::dvec3 PolygonNormal(std::span<const glm::vec3> corners) {
  glm::dvec3 sum(0);
  const glm::dvec3 origin(corners[0]);
  for (std::size_t i = 0; i + 1 < corners.size(); ++i)
    sum += glm::cross(glm::dvec3(corners[i]) - origin, glm::dvec3(corners[i + 1]) - origin);
  return sum;
}

// Seen along the normal's largest component, from the side where the polygon is counter-clockwise.
std::vector<glm::dvec2> Flatten(std::span<const glm::vec3> corners) {
  const glm::dvec3 n = PolygonNormal(corners), a = glm::abs(n);
  const int drop = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  const int u = (drop + 1) % 3, v = (drop + 2) % 3;
  const double sign = n[drop] < 0 ? -1 : 1;
  std::vector<glm::dvec2> flat;
  for (const glm::vec3& p : corners) flat.emplace_back(sign * p[u], p[v]);
  return flat;
}

double Cross(glm::dvec2 a, glm::dvec2 b, glm::dvec2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

class EarClipper {
 public:
  explicit EarClipper(std::span<const glm::vec3> corners)
      : points_(Flatten(corners)), left_(corners.size()) {
    std::iota(left_.begin(), left_.end(), 0);
  }

  void Run(std::vector<Face>& triangles) {
    while (left_.size() >= 3) {
      const std::size_t tip = FindEar();
      triangles.push_back({At(tip - 1), At(tip), At(tip + 1)});
      left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(tip % left_.size()));
    }
  }

 private:
  std::int32_t At(std::size_t i) const { return left_[i % left_.size()]; }

  // From 1 on, so that a convex polygon becomes the fan about corner 0. 1 where there is no ear.
  std::size_t FindEar() const {
    for (std::size_t tip = 1; tip <= left_.size(); ++tip) {
      if (IsEar(tip)) return tip;
    }
    return 1;
  }

  bool IsEar(std::size_t tip) const {
    const glm::dvec2 a = points_[At(tip - 1)], b = points_[At(tip)], c = points_[At(tip + 1)];
    if (Cross(a, b, c) <= 0) return false;
    return std::none_of(left_.begin(), left_.end(), [&](std::int32_t i) {
      const glm::dvec2 p = points_[i];
      if (p == a || p == b || p == c) return false;
      return Cross(a, b, p) >= 0 && Cross(b, c, p) >= 0 && Cross(c, a, p) >= 0;
    });
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::int32_t> left_;  // corners not yet clipped, in order
};

}  // namespace

void TriangulatePolygon(std::span<const glm::vec3> corners, std::vector<Face>& triangles) {
  triangles.clear();
  const std::size_t n = corners.size();
  if (n > 3 && n <= kMaxEarCorners) return EarClipper(corners).Run(triangles);
  for (std::int32_t k = 2; k < static_cast<std::int32_t>(n); ++k)
    triangles.push_back({0, k - 1, k});
}

}  // namespace tilegrad

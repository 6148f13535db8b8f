// SPDX-License-Identifier: Apache-2.0
#include "scene/sphere_uv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace tilegrad {
namespace {

struct CornerUv {
  float u, v;
  bool pole;
};

CornerUv UvOf(glm::vec3 p) {
  const double radius = std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y +
                                  static_cast<double>(p.z) * p.z);
  const double u = 0.5 + std::atan2(-static_cast<double>(p.z), static_cast<double>(p.x)) /
                             (2 * std::numbers::pi);
  const double v = 0.5 + std::asin(std::clamp(p.y / radius, -1.0, 1.0)) / std::numbers::pi;
  return {static_cast<float>(u), static_cast<float>(v),
          std::hypot(p.x, p.z) < 1e-6f * static_cast<float>(radius)};
}

// Corners of one face, all on one side of the seam.
void Unwrap(std::array<CornerUv, 3>* corners) {
  float largest = 0, sum = 0;
  int others = 0;
  for (const CornerUv& c : *corners) {
    if (!c.pole) largest = std::max(largest, c.u);
  }
  for (CornerUv& c : *corners) {
    if (c.pole) continue;
    if (largest - c.u > 0.5f) c.u += 1;
    sum += c.u;
    ++others;
  }
  for (CornerUv& c : *corners) {
    if (c.pole && others > 0) c.u = sum / static_cast<float>(others);
  }
}

glm::dvec3 DirectionAt(double u, double v) {
  const double turn = 2 * std::numbers::pi * (u - 0.5), up = std::numbers::pi * (v - 0.5);
  return {std::cos(turn) * std::cos(up), std::sin(up), -std::sin(turn) * std::cos(up)};
}

// The normals of the planes through the origin and each edge of a face.
struct FaceCone {
  std::array<glm::dvec3, 3> sides;
  glm::dvec3 WeightsAt(const glm::dvec3& d) const {
    return {glm::dot(d, sides[0]), glm::dot(d, sides[1]), glm::dot(d, sides[2])};
  }
};

FaceCone ConeOf(const Mesh& sphere, const Face& face) {
  const auto corner = [&](std::size_t k) {
    return glm::dvec3(sphere.positions[static_cast<std::size_t>(face[k])]);
  };
  const glm::dvec3 a = corner(0), b = corner(1), c = corner(2);
  return {{glm::cross(b, c), glm::cross(c, a), glm::cross(a, b)}};
}

// Of the face that the ray runs through; on an edge rounding may leave every face outside by a
// hair.
SurfacePoint PointAt(const Mesh& sphere, const std::vector<FaceCone>& cones, const glm::dvec3& d) {
  std::size_t best = 0;
  double inside = -std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < cones.size(); ++f) {
    const glm::dvec3 w = cones[f].WeightsAt(d);
    const double least =
        std::min({w.x, w.y, w.z}) / (std::abs(w.x) + std::abs(w.y) + std::abs(w.z));
    if (least > inside) {
      inside = least;
      best = f;
    }
  }
  const glm::dvec3 w = glm::max(cones[best].WeightsAt(d), glm::dvec3(0));
  const double sum = w.x + w.y + w.z;
  return {static_cast<std::int32_t>(best),
          sphere.faces[best],
          {static_cast<float>(w.x / sum), static_cast<float>(w.y / sum),
           static_cast<float>(w.z / sum)}};
}

}  // namespace

std::vector<SurfacePoint> SphereTexels(const Mesh& sphere, int width, int height) {
  std::vector<FaceCone> cones;
  cones.reserve(sphere.faces.size());
  for (const Face& face : sphere.faces) cones.push_back(ConeOf(sphere, face));
  std::vector<SurfacePoint> points;
  points.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j)
      points.push_back(
          PointAt(sphere, cones, DirectionAt((j + 0.5) / width, 1 - (i + 0.5) / height)));
  }
  return points;
}

std::vector<glm::vec2> SphereUvs(const Mesh& sphere) {
  std::vector<glm::vec2> uvs;
  uvs.reserve(3 * sphere.faces.size());
  for (const Face& face : sphere.faces) {
    std::array<CornerUv, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = UvOf(sphere.positions[static_cast<std::size_t>(face[k])]);
    }
    Unwrap(&corners);
    for (const CornerUv& c : corners) uvs.emplace_back(c.u, c.v);
  }
  return uvs;
}

}  // namespace tilegrad

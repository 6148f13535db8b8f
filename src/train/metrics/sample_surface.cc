// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "base/rng.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

glm::dvec3 Corner(const Mesh& mesh, const Face& face, std::size_t k) {
  return glm::dvec3(mesh.positions[static_cast<std::size_t>(face[k])]);
}

// Uniform in a triangle: the square root makes the density even (Osada et al.: Shape
// distributions, 2002).
glm::vec3 PointIn(const Mesh& mesh, const Face& face, double r1, double r2) {
  const double u = std::sqrt(r1);
  return glm::vec3((1 - u) * Corner(mesh, face, 0) + u * (1 - r2) * Corner(mesh, face, 1) +
                   u * r2 * Corner(mesh, face, 2));
}

}  // namespace

Result<std::vector<glm::vec3>> SampleSurface(const Mesh& mesh, int count, std::uint64_t seed) {
  TILEGRAD_TRY(Validate(mesh));
  if (count < 0) return InvalidArgument("the number of points must not be negative");
  std::vector<double> area_up_to;
  double area = 0;
  for (const Face& face : mesh.faces) {
    const glm::dvec3 a = Corner(mesh, face, 0);
    area += glm::length(glm::cross(Corner(mesh, face, 1) - a, Corner(mesh, face, 2) - a));
    area_up_to.push_back(area);
  }
  if (!(area > 0)) return InvalidArgument("the surface has no area");
  Rng rng(seed);
  std::vector<glm::vec3> points;
  points.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    // Uniform() < 1 and rounding could still give `area` itself, hence the last face.
    const auto at =
        std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, rng.Uniform() * area);
    const Face& face = mesh.faces[static_cast<std::size_t>(at - area_up_to.begin())];
    const double r1 = rng.Uniform(), r2 = rng.Uniform();
    points.push_back(PointIn(mesh, face, r1, r2));
  }
  return points;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_origin.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <set>

#include "base/error.h"

namespace tilegrad::io {
namespace {

constexpr double kFar = 256;         // times its size
constexpr double kTooCoarse = 1024;  // steps across the mesh

struct ExactBounds {
  glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-low};
  double size() const { return std::max({high.x - low.x, high.y - low.y, high.z - low.z}); }
  double farthest(int axis) const { return std::max(std::abs(low[axis]), std::abs(high[axis])); }
};

// Indices are not checked yet.
template <class Use>
void EachUsed(const LoadedMesh& loaded, Use use) {
  for (const Face& face : loaded.mesh.faces) {
    for (const std::int32_t v : face) {
      if (v >= 0 && static_cast<std::size_t>(v) < loaded.exact.size()) use(loaded.exact[v]);
    }
  }
}

ExactBounds BoundsOf(const LoadedMesh& loaded) {
  ExactBounds b;
  EachUsed(loaded, [&](const glm::dvec3& p) {
    b.low = glm::min(b.low, p);
    b.high = glm::max(b.high, p);
  });
  return b;
}

double FloatStep(double value) {
  const auto f = static_cast<float>(value);
  return std::nextafter(f, std::numeric_limits<float>::infinity()) - f;
}

// The steps in which the coordinates of an axis come, if all are numbers of float's precision, of
// which the mesh spans too few; else 0. Text with few digits gives such numbers, too.
double CoarseStep(const LoadedMesh& loaded, const ExactBounds& bounds, int axis) {
  const double step = FloatStep(bounds.farthest(axis));
  if (step * kTooCoarse <= bounds.size()) return 0;
  bool floats = true;
  std::set<double> values;
  EachUsed(loaded, [&](const glm::dvec3& p) {
    floats = floats && static_cast<double>(static_cast<float>(p[axis])) == p[axis];
    if (floats && values.size() < 2 * kTooCoarse) values.insert(p[axis]);
  });
  if (!floats || values.size() < 3) return 0;  // two values, as of a box, say nothing about steps
  double least = std::numeric_limits<double>::infinity();
  for (auto at = values.begin(); at != values.end() && std::next(at) != values.end(); ++at)
    least = std::min(least, *std::next(at) - *at);
  return std::isfinite(least) ? std::max(least, step) : step;
}

std::string Point(const glm::dvec3& p) { return fmt::format("({}, {}, {})", p.x, p.y, p.z); }

void WarnOfSteps(LoadedMesh& loaded, const ExactBounds& bounds, const glm::dvec3& origin) {
  std::string axes;
  double step = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double here = CoarseStep(loaded, bounds, axis);
    if (here > 0) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", "xyz"[axis]);
    step = std::max(step, here);
  }
  if (axes.empty()) return;
  loaded.warnings.push_back(
      fmt::format("the coordinates lack precision: around {}, {} come in steps of {}, and the mesh "
                  "is {} across; move it near the origin, or write more digits",
                  Point(origin), axes, step, bounds.size()));
}

// A round point near the middle, so that subtracting it leaves round numbers round.
glm::dvec3 OriginFor(const ExactBounds& bounds) {
  const double unit = std::exp2(std::ceil(std::log2(bounds.size())));
  return unit * glm::round((0.5 * bounds.low + 0.5 * bounds.high) / unit);
}

void MoveCameras(LoadedMesh& loaded) {
  for (MeshFileCamera& camera : loaded.cameras) {
    for (int axis = 0; axis < 3; ++axis)
      camera.camera.node_to_world[static_cast<std::size_t>(4 * axis + 3)] -= loaded.origin[axis];
  }
}

}  // namespace

void PlaceNearOrigin(LoadedMesh& loaded) {
  const ExactBounds bounds = BoundsOf(loaded);
  const double farthest = std::max({bounds.farthest(0), bounds.farthest(1), bounds.farthest(2)});
  if (bounds.size() > 0 && std::isfinite(farthest) && farthest > kFar * bounds.size()) {
    loaded.origin = OriginFor(bounds);
    MoveCameras(loaded);
    loaded.warnings.push_back(fmt::format(
        "{} was subtracted from all coordinates, which are too far from the origin for their size",
        Point(loaded.origin)));
    WarnOfSteps(loaded, bounds, loaded.origin);
  }
  loaded.mesh.positions.clear();
  for (const glm::dvec3& p : loaded.exact) loaded.mesh.positions.emplace_back(p - loaded.origin);
  loaded.exact = {};
}

}  // namespace tilegrad::io

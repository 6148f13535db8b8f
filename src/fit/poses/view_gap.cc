// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/view_gap.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>
#include <vector>

#include "fit/masks/floor.h"

namespace tilegrad::train {
namespace {

constexpr int kStep = 5, kFullTurn = 360, kHighest = 60;  // degrees
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kBeside = 7.5;  // degrees: what is less far to a side is not worth saying

// Degrees around the object, counterclockwise seen from above, and above its level.
struct Direction {
  double around, above;
};

// The object's level plane.
class Level {
 public:
  explicit Level(const glm::dvec3& up) : up_(up) {
    const glm::dvec3 any = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
    east_ = glm::normalize(any - glm::dot(any, up) * up);
    north_ = glm::cross(up, east_);
  }
  Direction Of(const glm::dvec3& v) const {
    const double height = glm::dot(v, up_) / glm::length(v);
    return {std::atan2(glm::dot(v, north_), glm::dot(v, east_)) / kDegree,
            std::asin(std::clamp(height, -1.0, 1.0)) / kDegree};
  }

 private:
  glm::dvec3 up_, east_, north_;
};

double Between(const Direction& a, const Direction& b) {
  const double cosine = std::sin(a.above * kDegree) * std::sin(b.above * kDegree) +
                        std::cos(a.above * kDegree) * std::cos(b.above * kDegree) *
                            std::cos((a.around - b.around) * kDegree);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) / kDegree;
}

glm::dvec3 EyeOf(const Camera& c) {  // -R^T t
  glm::dvec3 eye(0);
  for (int i = 0; i < 9; ++i)
    eye[i % 3] -= static_cast<double>(c.rotation[i]) * static_cast<double>(c.translation[i / 3]);
  return eye;
}

std::vector<Direction> DirectionsOf(std::span<const Camera> cameras, const glm::dvec3& middle) {
  const Level level{glm::normalize(glm::dvec3(UpOf(cameras)))};
  std::vector<Direction> out;
  for (const Camera& c : cameras) out.push_back(level.Of(EyeOf(c) - middle));
  return out;
}

ViewGap GapAt(const Direction& place, std::span<const Direction> views) {
  ViewGap gap;
  gap.degrees = HUGE_VAL;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const double degrees = Between(place, views[v]);
    if (degrees >= gap.degrees) continue;
    gap = {v, degrees, std::remainder(place.around - views[v].around, kFullTurn),
           place.above - views[v].above};
  }
  return gap;
}

}  // namespace

ViewGap WidestGap(std::span<const Camera> cameras, glm::vec3 middle) {
  const std::vector<Direction> views = DirectionsOf(cameras, glm::dvec3(middle));
  ViewGap widest;
  for (int above = 0; above <= kHighest; above += kStep) {
    for (int around = 0; around < kFullTurn; around += kStep) {
      const Direction place = {static_cast<double>(around), static_cast<double>(above)};
      const ViewGap gap = GapAt(place, views);
      if (gap.degrees > widest.degrees) widest = gap;
    }
  }
  return widest;
}

std::string DescribePlace(const ViewGap& gap, const std::string& name) {
  const auto sideways = fmt::format("{:.0f} degrees to the {} of {}", std::abs(gap.right),
                                    gap.right > 0 ? "right" : "left", name);
  const auto upwards =
      fmt::format("{:.0f} degrees {}", std::abs(gap.up), gap.up > 0 ? "higher" : "lower");
  if (std::abs(gap.up) < kBeside) return "about " + sideways;
  if (std::abs(gap.right) < kBeside) return fmt::format("about {} than {}", upwards, name);
  return fmt::format("about {} and {}", sideways, upwards);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "scene/lens_distortion.h"

#include <algorithm>
#include <cmath>

namespace tilegrad {
namespace {

constexpr double kWidest = 11.43;  // tan(85 degrees)

Vec2Array BentByBrown(const std::array<double, 8>& k, const Vec2Array& at) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = k;
  const auto [x, y] = at;
  const double r = x * x + y * y;
  const double radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)));
  return {x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
          y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y};
}

Vec2Array BentByFisheye(const std::array<double, 8>& k, const Vec2Array& at) {
  const double radius = std::hypot(at[0], at[1]);
  if (!(radius > 0)) return at;
  const double angle = std::atan(radius), a = angle * angle;
  const double shown = angle * (1 + a * (k[0] + a * (k[1] + a * (k[2] + a * k[3]))));
  return {at[0] * shown / radius, at[1] * shown / radius};
}

// Along the x axis, without tangential distortion.
double RadiusShown(LensDistortion lens, double radius) {
  if (lens.model == LensDistortion::Model::kBrown) lens.k[2] = lens.k[3] = 0;
  return Bent(lens, {radius, 0})[0];
}

}  // namespace

LensDistortion BrownLens(const std::array<double, 8>& k) {
  const bool zero = std::ranges::all_of(k, [](double x) { return x == 0; });
  return {zero ? LensDistortion::Model::kStraight : LensDistortion::Model::kBrown, k};
}

LensDistortion FisheyeLens(const std::array<double, 4>& k) {
  return {LensDistortion::Model::kFisheye, {k[0], k[1], k[2], k[3]}};
}

Vec2Array Bent(const LensDistortion& lens, const Vec2Array& place) {
  switch (lens.model) {
    case LensDistortion::Model::kBrown:
      return BentByBrown(lens.k, place);
    case LensDistortion::Model::kFisheye:
      return BentByFisheye(lens.k, place);
    default:
      return place;
  }
}

double LargestRadius(const LensDistortion& lens) {
  constexpr int kSteps = 4096;
  double before = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double shown = RadiusShown(lens, kWidest * i / kSteps);
    if (!(shown > before && std::isfinite(shown))) return kWidest * (i - 1) / kSteps;
    before = shown;
  }
  return kWidest;
}

// Newton's method with difference quotients.
std::optional<Vec2Array> Unbent(const LensDistortion& lens, const Vec2Array& bent, double largest) {
  constexpr int kMostSteps = 30;
  constexpr double kStep = 1e-6, kClose = 1e-9;
  Vec2Array at = bent;
  for (int i = 0; i < kMostSteps; ++i) {
    const double radius = std::hypot(at[0], at[1]);
    if (radius > largest) at = {at[0] * largest / radius, at[1] * largest / radius};
    const Vec2Array f = Bent(lens, at);
    const double gap_x = bent[0] - f[0], gap_y = bent[1] - f[1];
    if (std::hypot(gap_x, gap_y) < kClose) return at;
    const Vec2Array right = Bent(lens, {at[0] + kStep, at[1]}),
                    down = Bent(lens, {at[0], at[1] + kStep});
    const double a = (right[0] - f[0]) / kStep, b = (down[0] - f[0]) / kStep,
                 c = (right[1] - f[1]) / kStep, d = (down[1] - f[1]) / kStep;
    const double determinant = a * d - b * c;
    at[0] += (d * gap_x - b * gap_y) / determinant;
    at[1] += (a * gap_y - c * gap_x) / determinant;
    if (!std::isfinite(at[0]) || !std::isfinite(at[1])) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace tilegrad

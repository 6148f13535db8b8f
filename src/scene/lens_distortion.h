// SPDX-License-Identifier: Apache-2.0
// Lens distortion models of OpenCV and COLMAP. The cameras of this project have no distortion:
// fit/undistort.h undistorts images first.
#pragma once

#include <array>
#include <optional>

#include "scene/camera_conventions.h"

namespace tilegrad {

struct LensDistortion {
  enum class Model {
    kStraight,
    kBrown,   // k1 k2 p1 p2 k3 k4 k5 k6, in the order of cv::undistort
    kFisheye  // k1 k2 k3 k4, of cv::fisheye
  };
  Model model = Model::kStraight;
  std::array<double, 8> k = {};

  bool straight() const { return model == Model::kStraight; }
};

// kBrown with these coefficients; kStraight if all of them are 0.
LensDistortion BrownLens(const std::array<double, 8>& k);
LensDistortion FisheyeLens(const std::array<double, 4>& k);

// Points below are normalised image coordinates: relative to the principal point, in focal lengths,
// y down.

// Distorts a point.
Vec2Array Bent(const LensDistortion& lens, const Vec2Array& place);

// The largest radius up to which Bent increases monotonically; beyond, a polynomial turns back or
// the lens sees nothing. At most tan(85 degrees).
double LargestRadius(const LensDistortion& lens);

// Undistorts: the point within radius `largest` (LargestRadius of the lens) that Bent maps to
// `bent`; nullopt if there is none.
std::optional<Vec2Array> Unbent(const LensDistortion& lens, const Vec2Array& bent, double largest);

}  // namespace tilegrad

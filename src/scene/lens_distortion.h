// SPDX-License-Identifier: Apache-2.0
// Lenses that bend rays, as OpenCV and COLMAP describe them. The cameras of this project have
// straight ones: pictures of others are undistorted first (fit/undistort.h).
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

// kBrown with these coefficients, kStraight where all of them are 0.
LensDistortion BrownLens(const std::array<double, 8>& k);
LensDistortion FisheyeLens(const std::array<double, 4>& k);

// Places on an image below: from the principal point, in units of the focal length, y down.

// Where the lens shows what a straight one shows at `place`.
Vec2Array Bent(const LensDistortion& lens, const Vec2Array& place);

// From the middle to here Bent goes outwards; beyond, a polynomial turns back or a lens sees
// nothing. At most tan(85 degrees).
double LargestRadius(const LensDistortion& lens);

// The place within `largest`, LargestRadius of the lens, that Bent takes to `bent`; none where
// there is none.
std::optional<Vec2Array> Unbent(const LensDistortion& lens, const Vec2Array& bent, double largest);

}  // namespace tilegrad

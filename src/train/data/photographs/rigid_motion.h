// SPDX-License-Identifier: Apache-2.0
// The alternation behind factorization.h, before shapes are turned to an object's axes.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

using KeypointRows = std::vector<std::vector<Keypoint>>;  // [view][keypoint]

struct RigidMotion {
  std::vector<WeakPerspective> cameras;  // of the views
  std::vector<std::array<double, 3>> shape;
  double squares = 0;  // of the residuals
};

// Rows of three numbers and a shift for each view, and points, in turn by least squares from a
// random start; then the map after which rows are orthogonal and as long as each other; then
// cameras and points in turn. Views are to be of about unit extent.
RigidMotion FindRigidMotion(const KeypointRows& views, std::uint64_t seed);

// Of one keypoint, where cameras are known: by least squares over the views that see it; the origin
// if none does.
std::array<double, 3> LocateKeypoint(const KeypointRows& views,
                                     const std::vector<WeakPerspective>& cameras, std::size_t k);

}  // namespace tilegrad::train

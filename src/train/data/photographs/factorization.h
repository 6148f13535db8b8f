// SPDX-License-Identifier: Apache-2.0
// Structure from motion for scaled orthography: cameras and a mean shape from keypoints of many
// objects of one class, one view of each, as CMR's preprocessing finds them.
//
// C. Tomasi, T. Kanade, "Shape and motion from image streams under orthography", IJCV 9(2), 1992,
// with missing points by alternation; the views are joined by their mirror images.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "scene/weak_perspective.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

struct KeypointViews {
  std::vector<std::vector<Keypoint>> views;  // at least four visible in each
  std::vector<int> mirror;                   // PhotographSet::mirror
  // Pairs of keypoints (from, to), whose mean direction is an axis: to the object's left (+x), up
  // (+y) and to its front (+z). `left` is required; without both others, the longest extent across
  // x is taken as the front.
  std::vector<std::pair<int, int>> left, up, front;
};

struct Structure {
  std::vector<std::array<double, 3>> shape;  // symmetric at x = 0, largest distance 2
  std::vector<WeakPerspective> cameras;      // of the views, in their pixels
  double error = 0;  // root mean square over visible keypoints, in units of a view's extent
};

// Orthographic positions cannot tell a shape from its reflection in depth: without all three axes,
// visible keypoints count as nearer than hidden ones. InvalidArgument: too few views or keypoints.
Result<Structure> FactorizeKeypoints(const KeypointViews& job);

// Triangulates the keypoints from known cameras, by least squares over all views; the origin for a
// keypoint that none sees.
std::vector<std::array<double, 3>> LocateKeypoints(const std::vector<std::vector<Keypoint>>& views,
                                                   const std::vector<WeakPerspective>& cameras);

// The camera that projects `shape` best onto the visible keypoints (least squares,
// Levenberg-Marquardt), from `start`.
WeakPerspective FitWeakCamera(const std::vector<std::array<double, 3>>& shape,
                              const std::vector<Keypoint>& keypoints, WeakPerspective start);
// Root mean square of the distances in pixels.
double WeakCameraError(const std::vector<std::array<double, 3>>& shape,
                       const std::vector<Keypoint>& keypoints, const WeakPerspective& camera);

}  // namespace tilegrad::train

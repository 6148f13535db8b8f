// SPDX-License-Identifier: Apache-2.0
// Scenes that the promise of max_alpha_error is held to, through the Renderer: no background pixel
// is farther from equation 6 over all faces than E, nor than Frame::alpha_error_bound says,
// rounding aside (docs/numerics.md, "Rounding"); and in whatever order the faces stand.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "tilegrad/renderer.h"

namespace tilegrad::test {

// Violations are beyond rounding, and 0 if the promise is kept.
struct BoundSummary {
  std::size_t scenes = 0, pixels = 0, faces = 0, between = 0;  // between: neither 0 nor 1
  double over_budget = 0;                                      // largest error - E
  double over_spent = 0;                                       // largest error - alpha_error_bound
  double spent_over = 0;                                       // largest alpha_error_bound - E
  double order = 0;        // how far permuting moved alpha beyond what both runs spent
  double share = 0;        // largest error beyond rounding / E
  double of_reported = 0;  // largest error / (alpha_error_bound + rounding): below 1 if all is well
  std::string failed;      // why a scene could not be drawn

  void Add(const BoundSummary& o) {
    scenes += o.scenes;
    pixels += o.pixels;
    faces += o.faces;
    between += o.between;
    over_budget = std::max(over_budget, o.over_budget);
    over_spent = std::max(over_spent, o.over_spent);
    spent_over = std::max(spent_over, o.spent_over);
    order = std::max(order, o.order);
    share = std::max(share, o.share);
    of_reported = std::max(of_reported, o.of_reported);
    if (failed.empty()) failed = o.failed;
  }
  bool Kept() const {
    return failed.empty() && std::max({over_budget, over_spent, spent_over, order}) <= 0;
  }
};

// A scene is a pure function of its number: 20 to 20 * 10^decades faces, delta over six decades.
struct BoundSceneNumber {
  std::uint64_t number;
  double decades = 4;
};

// Draws the scene twice, faces permuted the second time, and compares some of its pixels. `delta`,
// if given, is set to the scene's.
BoundSummary CheckBoundScene(const BoundSceneNumber& scene, Renderer* renderer,
                             double* delta = nullptr);

}  // namespace tilegrad::test

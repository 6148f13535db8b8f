// SPDX-License-Identifier: Apache-2.0
// What is drawn by lot of one streamed object: its shape, made from a mesh of the dataset. It
// follows from the state of the random numbers.
#pragma once

#include <span>
#include <vector>

#include "base/rng.h"
#include "scene/mesh.h"
#include "train/data/stream/stream_config.h"

namespace tilegrad::train {

// A monotone map of an interval onto another, linear between knots: each of its pieces is scaled
// by a factor of its own, and straight lines along the axis stay straight.
class AxisWarp {
 public:
  static constexpr int kPieces = 4;
  // Of [-half, half]; factors within exp(+-stretch). `even`: odd as a function, so that what is
  // symmetric at 0 stays so.
  AxisWarp(Rng& rng, double half, double stretch, bool even);
  float operator()(float x) const;

 private:
  double low_, step_;
  double knots_[kPieces + 1], slopes_[kPieces];
};

// Deforms a copy of `positions`, whose bounding box is centred with this largest half-extent; so is
// the result's.
void DrawShape(const StreamConfig& config, std::span<const glm::vec3> positions, float half_extent,
               Rng& rng, std::vector<glm::vec3>* out);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// What is drawn by lot of one streamed object: its shape and its colours, made from a mesh of the
// dataset. All of it follows from the state of the random numbers.
#pragma once

#include <span>
#include <vector>

#include "base/rng.h"
#include "scene/mesh.h"
#include "train/data/stream/stream_config.h"

namespace tilegrad::train {

// A mesh with a colour for each vertex, without anything else.
struct ColoredMesh {
  std::vector<glm::vec3> positions;  // [V]; bounding box centred, largest half-extent `half_extent`
  std::vector<glm::vec3> colors;     // [V] unlit, [0, 1]
  std::vector<Face> faces;
};

// Positions and colours of a deformed copy; memory is reused from object to object.
struct ObjectDraw {
  std::vector<glm::vec3> positions, colors;
};

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

// Deforms and recolours; then the bounding box is centred and scaled to `half_extent` again.
void DrawObject(const StreamConfig& config, const ColoredMesh& mesh, float half_extent, Rng& rng,
                ObjectDraw* out);

}  // namespace tilegrad::train

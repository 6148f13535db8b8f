// SPDX-License-Identifier: Apache-2.0
// The best-fitting light of a picture, given an estimate of the object: a search over many
// directions, whose result is a target for the network. Far from the right light the colour error
// has little gradient (unlit surfaces stay black), so that a network which follows it learns
// slowly. Directional light is compared by Lambert's law (Phong highlights remain as error), light
// of a sky and a direction by SkyAndLight.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "train/data/stream/light_draw.h"
#include "train/models/render_op.h"
#include "train/models/texture_network.h"

namespace tilegrad::train {

// One picture of `pixels` pixels, planar.
template <class T>
struct LightEvidence {
  std::span<const T> texture;  // [3][pixels]: the object in this view without light
  std::span<const T> normals;  // [3][pixels]: unit, in world axes; 0 beside the object
  std::span<const T> picture;  // [3][pixels]
  std::span<const T> cover;    // [pixels]: how much of each is the object, in [0, 1]
};

struct FoundLight {
  std::array<double, 3> direction = {};  // unit, in the camera's axes; 0: the picture shows nothing
  double sky = 0;                        // share of uniform light from all around; harmonics only
};

// Tries directions spread evenly over a spherical cap, then finer around the best one, for
// harmonics each with its best sky; compares by L1.
class LightSearch {
 public:
  explicit LightSearch(const LightConfig& config);

  // `rotation` of the camera, row-major.
  template <class T>
  FoundLight Find(const LightEvidence<T>& evidence, std::span<const float, 9> rotation) const;

 private:
  class Attempts;

  LightConfig config_;
  bool has_sky_;
  double cosine_;  // of the cap
  std::vector<std::array<double, 3>> directions_;
};

}  // namespace tilegrad::train

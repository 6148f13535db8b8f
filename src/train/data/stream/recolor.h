// SPDX-License-Identifier: Apache-2.0
// Other colours for a streamed object, drawn by lot.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "base/rng.h"
#include "train/data/stream/stream_config.h"

namespace tilegrad::train {

// The numbers of colours or points, one after the other.
inline std::span<const float> Flat(const std::vector<glm::vec3>& values) {
  return {&values.data()->x, 3 * values.size()};
}

// Turns hues by an angle about the grey axis and keeps luminance (YIQ), then mixes in a tint of the
// same luminance; a brightness for all. Colours in [0, 1] stay there.
class Recolor {
 public:
  Recolor(const StreamConfig& config, Rng& rng);
  glm::vec3 operator()(glm::vec3 color) const;

 private:
  glm::mat3 turn_ = glm::mat3(1);
  glm::vec3 tint_ = glm::vec3(1);
  float tinted_ = 0, brightness_ = 1;
};

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// What is drawn by lot of one streamed object: its shape, made from a mesh of the dataset, its
// colours, the cameras that see it, and the light that is the same for all of them. It follows from
// the state of the random numbers.
#pragma once

#include <array>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "base/rng.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"
#include "train/data/dataset.h"
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

// The numbers of colours or points, one after the other.
inline std::span<const float> Flat(const std::vector<glm::vec3>& values) {
  return {&values.data()->x, 3 * values.size()};
}

// Turns hues by an angle about the grey axis and keeps luminance (YIQ), then mixes in a tint of the
// same luminance; a brightness for all. Colours in [0, 1] stay there.
class Recolor {
 public:
  Recolor(const StreamConfig& config, Rng& rng);
  glm::vec3 operator()(glm::vec3 color) const {
    return glm::clamp(map_ * color, glm::vec3(0), glm::vec3(1));
  }

 private:
  glm::mat3 map_ = glm::mat3(1);
};

// View 0 is what the network sees; the others have a range of elevations of their own. Azimuth from
// all the circle; the size of objects in the image is that of `rule`, within jitter. With
// fixed_camera only the azimuth is drawn, and all else is of `rule`.
Camera DrawCamera(const StreamConfig& config, const CameraRule& rule, std::size_t view, Rng& rng);

// The key and the fill light of datasets, each turned about the vertical and up or down.
std::array<Light, 2> DrawLights(const StreamConfig& config, Rng& rng);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/recolor.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/matrix.hpp>
#include <numbers>

namespace tilegrad::train {
namespace {

float Luminance(glm::vec3 c) { return 0.299f * c.r + 0.587f * c.g + 0.114f * c.b; }

// Columns are the images of red, green and blue.
glm::mat3 HueTurn(double angle) {
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  const glm::mat3 to_yiq(0.299f, 0.596f, 0.211f, 0.587f, -0.274f, -0.523f, 0.114f, -0.322f, 0.312f);
  const glm::mat3 rotate(1, 0, 0, 0, c, s, 0, -s, c);
  return glm::inverse(to_yiq) * rotate * to_yiq;
}

}  // namespace

Recolor::Recolor(const StreamConfig& config, Rng& rng) {
  const bool other = rng.Uniform() < config.recolor;
  const double angle = rng.Uniform(0, 2 * std::numbers::pi);
  const glm::vec3 towards(rng.Uniform(), rng.Uniform(), rng.Uniform());
  const double share = rng.Uniform();
  brightness_ = static_cast<float>(std::exp(rng.Uniform(-config.brightness, config.brightness)));
  if (!other) return;
  turn_ = HueTurn(angle);
  tint_ = towards / std::max(0.1f, Luminance(towards));
  tinted_ = static_cast<float>(share * share);
}

glm::vec3 Recolor::operator()(glm::vec3 color) const {
  color = turn_ * color;
  color = glm::mix(color, Luminance(color) * tint_, tinted_);
  return glm::clamp(brightness_ * color, glm::vec3(0), glm::vec3(1));
}

}  // namespace tilegrad::train

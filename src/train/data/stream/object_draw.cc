// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/object_draw.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace tilegrad::train {
namespace {

double Factor(Rng& rng, double log_range) { return std::exp(rng.Uniform(-log_range, log_range)); }

void Normalize(float half_extent, std::vector<glm::vec3>* positions) {
  glm::vec3 low = positions->front(), high = low;
  for (const glm::vec3& p : *positions) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  const glm::vec3 half = 0.5f * (high - low), centre = 0.5f * (high + low);
  const float scale = half_extent / std::max({half.x, half.y, half.z, 1e-6f});
  for (glm::vec3& p : *positions) p = scale * (p - centre);
}

}  // namespace

AxisWarp::AxisWarp(Rng& rng, double half, double stretch, bool even)
    : low_(-half), step_(2 * half / kPieces) {
  for (double& slope : slopes_) slope = Factor(rng, stretch);
  for (int i = 0; even && i < kPieces / 2; ++i) slopes_[i] = slopes_[kPieces - 1 - i];
  knots_[kPieces / 2] = 0;
  for (int i = kPieces / 2; i < kPieces; ++i) knots_[i + 1] = knots_[i] + step_ * slopes_[i];
  for (int i = kPieces / 2; i > 0; --i) knots_[i - 1] = knots_[i] - step_ * slopes_[i - 1];
}

float AxisWarp::operator()(float x) const {
  const double at = (x - low_) / step_;
  const int piece = std::clamp(static_cast<int>(std::floor(at)), 0, kPieces - 1);
  return static_cast<float>(knots_[piece] + slopes_[piece] * step_ * (at - piece));
}

void DrawShape(const StreamConfig& config, std::span<const glm::vec3> positions, float half_extent,
               Rng& rng, std::vector<glm::vec3>* out) {
  const AxisWarp x(rng, half_extent, config.stretch, true);
  const AxisWarp y(rng, half_extent, config.stretch, false);
  const AxisWarp z(rng, half_extent, config.stretch, false);
  const glm::vec3 scale(Factor(rng, config.stretch), Factor(rng, config.stretch),
                        Factor(rng, config.stretch));
  const double taper = rng.Uniform(-config.taper, config.taper);
  out->clear();
  for (const glm::vec3& p : positions) {
    glm::vec3 q = scale * glm::vec3(x(p.x), y(p.y), z(p.z));
    const auto width = static_cast<float>(std::exp(0.5 * taper * p.y / half_extent));
    q.x *= width;
    q.z *= width;
    out->push_back(q);
  }
  Normalize(half_extent, out);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/object_draw.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

namespace tilegrad::train {
namespace {

double Factor(Rng& rng, double log_range) { return std::exp(rng.Uniform(-log_range, log_range)); }

// Turns hues by an angle about the grey axis and keeps luminance (YIQ), then mixes in a tint of the
// same luminance.
struct Recolor {
  glm::mat3 turn = glm::mat3(1);
  glm::vec3 tint = glm::vec3(1);
  float tinted = 0, brightness = 1;

  Recolor(const StreamConfig& config, Rng& rng) {
    const bool other = rng.Uniform() < config.recolor;
    const double angle = rng.Uniform(0, 2 * std::numbers::pi);
    const glm::vec3 towards(rng.Uniform(), rng.Uniform(), rng.Uniform());
    const double share = rng.Uniform();
    brightness = static_cast<float>(Factor(rng, config.brightness));
    if (!other) return;
    turn = HueTurn(angle);
    tint = towards / std::max(0.1f, Luminance(towards));
    tinted = static_cast<float>(share * share);
  }
  glm::vec3 operator()(glm::vec3 color) const {
    color = turn * color;
    color = glm::mix(color, Luminance(color) * tint, tinted);
    return glm::clamp(brightness * color, glm::vec3(0), glm::vec3(1));
  }

  static float Luminance(glm::vec3 c) { return 0.299f * c.r + 0.587f * c.g + 0.114f * c.b; }
  // Columns are the images of red, green and blue.
  static glm::mat3 HueTurn(double angle) {
    const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
    const glm::mat3 to_yiq(0.299f, 0.596f, 0.211f, 0.587f, -0.274f, -0.523f, 0.114f, -0.322f,
                           0.312f);
    const glm::mat3 rotate(1, 0, 0, 0, c, s, 0, -s, c);
    return glm::inverse(to_yiq) * rotate * to_yiq;
  }
};

void Normalize(float half_extent, std::vector<glm::vec3>* positions) {
  glm::vec3 low = positions->front(), high = low;
  for (const glm::vec3& p : *positions) low = glm::min(low, p), high = glm::max(high, p);
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

void DrawObject(const StreamConfig& config, const ColoredMesh& mesh, float half_extent, Rng& rng,
                ObjectDraw* out) {
  const AxisWarp x(rng, half_extent, config.stretch, true);
  const AxisWarp y(rng, half_extent, config.stretch, false);
  const AxisWarp z(rng, half_extent, config.stretch, false);
  const glm::vec3 scale(Factor(rng, config.stretch), Factor(rng, config.stretch),
                        Factor(rng, config.stretch));
  const double taper = rng.Uniform(-config.taper, config.taper);
  const Recolor recolor(config, rng);
  out->positions.clear(), out->colors.clear();
  for (const glm::vec3& p : mesh.positions) {
    glm::vec3 q = scale * glm::vec3(x(p.x), y(p.y), z(p.z));
    const auto width = static_cast<float>(std::exp(0.5 * taper * p.y / half_extent));
    q.x *= width, q.z *= width;
    out->positions.push_back(q);
  }
  for (const glm::vec3& color : mesh.colors) out->colors.push_back(recolor(color));
  Normalize(half_extent, &out->positions);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/object_draw.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"

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

constexpr glm::vec3 kLuminance(0.299f, 0.587f, 0.114f);

// Columns are the images of red, green and blue.
glm::mat3 HueTurn(double angle) {
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  const glm::mat3 to_yiq(0.299f, 0.596f, 0.211f, 0.587f, -0.274f, -0.523f, 0.114f, -0.322f, 0.312f);
  const glm::mat3 rotate(1, 0, 0, 0, c, s, 0, -s, c);
  return glm::inverse(to_yiq) * rotate * to_yiq;
}

constexpr double kDegree = std::numbers::pi / 180;

// Rotates the image plane by `angle` about the optical axis.
void Roll(double angle, Camera* camera) {
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  const auto turn = [&](float& x, float& y) {
    const float was = x;
    x = c * was - s * y;
    y = s * was + c * y;
  };
  for (int i = 0; i < 3; ++i) turn(camera->rotation[i], camera->rotation[3 + i]);
  turn(camera->translation[0], camera->translation[1]);
}

Light Turned(const Light& light, double azimuth, double elevation) {
  const auto& d = light.direction;
  const double at = std::atan2(d[2], d[0]) + azimuth;
  const double up = std::clamp(std::asin(double{d[1]}) + elevation, 5 * kDegree, 85 * kDegree);
  return {{static_cast<float>(std::cos(up) * std::cos(at)), static_cast<float>(std::sin(up)),
           static_cast<float>(std::cos(up) * std::sin(at))},
          light.intensity};
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

Recolor::Recolor(const StreamConfig& config, Rng& rng) {
  const bool other = rng.Uniform() < config.recolor;
  const double angle = rng.Uniform(0, 2 * std::numbers::pi);
  const glm::vec3 towards(rng.Uniform(), rng.Uniform(), rng.Uniform());
  const double share = rng.Uniform();
  const double brightness = std::exp(rng.Uniform(-config.brightness, config.brightness));
  if (other) {
    const glm::vec3 tint = towards / std::max(0.1f, glm::dot(kLuminance, towards));
    const auto tinted = static_cast<float>(share * share);
    map_ = ((1 - tinted) * map_ + tinted * glm::outerProduct(tint, kLuminance)) * HueTurn(angle);
  }
  map_ *= static_cast<float>(brightness);
}

Camera DrawCamera(const StreamConfig& config, const CameraRule& rule, std::size_t view, Rng& rng) {
  if (config.fixed_camera)
    return OrbitCamera(rule.lens, rng.Uniform(0, 360), rule.elevation, rule.distance);
  Lens lens = rule.lens;
  lens.fov_y = rng.Uniform(config.fov_low, config.fov_high);
  const double azimuth = rng.Uniform(0, 360);
  const double elevation = view == 0 ? rng.Uniform(config.elevation_low, config.elevation_high)
                                     : rng.Uniform(config.around_low, config.around_high);
  const double zoom = 1 + rng.Uniform(-config.jitter, config.jitter);
  const double focal = std::tan(0.5 * kDegree * rule.lens.fov_y);
  const double distance = zoom * rule.distance * focal / std::tan(0.5 * kDegree * lens.fov_y);
  Camera camera = OrbitCamera(lens, azimuth, elevation, distance);
  Roll(kDegree * rng.Uniform(-config.roll, config.roll), &camera);
  camera.cx += static_cast<float>(lens.width * rng.Uniform(-config.jitter, config.jitter));
  camera.cy += static_cast<float>(lens.height * rng.Uniform(-config.jitter, config.jitter));
  return camera;
}

std::array<Light, 2> DrawLights(const StreamConfig& config, Rng& rng) {
  std::array<Light, 2> lights = DatasetLights();
  for (Light& light : lights) {
    const double azimuth = config.light * rng.Uniform(-180, 180) * kDegree;
    light = Turned(light, azimuth, config.light * rng.Uniform(-60, 60) * kDegree);
  }
  return lights;
}

}  // namespace tilegrad::train

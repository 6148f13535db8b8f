// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/view_draw.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::train {
namespace {

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

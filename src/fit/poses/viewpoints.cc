// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/viewpoints.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

namespace tilegrad::train {
namespace {

constexpr int kSide = 64;  // pixels of a look around
constexpr double kDistance = 1.6, kFov = 45;
constexpr int kAround = 24;  // viewpoints on the horizon
constexpr double kLowestElevation = -45, kElevationStep = 12.5, kHighestElevation = 80;
constexpr int kLeastAround = 6;

std::vector<Camera> CamerasAround(const glm::dvec3& up) {
  const glm::dvec3 any = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 east = glm::normalize(any - glm::dot(any, up) * up);
  const glm::dvec3 south = glm::cross(east, up);
  const double target[3] = {0, 0, 0}, upward[3] = {up.x, up.y, up.z};
  std::vector<Camera> out;
  for (double e = kLowestElevation; e <= kHighestElevation; e += kElevationStep) {
    const double height = std::sin(e * std::numbers::pi / 180),
                 flat = std::sqrt(1 - height * height);
    const int count = std::max(kLeastAround, static_cast<int>(std::lround(kAround * flat)));
    for (int i = 0; i < count; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / count;
      const glm::dvec3 ring = std::cos(azimuth) * east + std::sin(azimuth) * south;
      const glm::dvec3 eye = kDistance * (flat * ring + height * up);
      const double from[3] = {eye.x, eye.y, eye.z};
      out.push_back(CameraCast<float>(LookAtCamera({kFov, kSide, kSide}, from, target, upward)));
    }
  }
  return out;
}

}  // namespace

Result<std::vector<Viewpoint>> LookAround(const FitScene& scene, const std::array<double, 3>& up,
                                          FitRenderer* renderer) {
  FitScene seen = scene;
  seen.cameras = CamerasAround({up[0], up[1], up[2]});
  std::vector<int> views(seen.cameras.size());
  std::iota(views.begin(), views.end(), 0);
  FitRenderer::Job job;
  job.views = views;
  job.alpha = false;
  job.options.width = job.options.height = kSide;
  TILEGRAD_TRY(renderer->Render(seen, job));
  const Images& images = renderer->images();
  constexpr std::size_t kPlane = std::size_t{kSide} * kSide;
  std::vector<Viewpoint> found;
  std::vector<float> alpha(kPlane);
  for (std::size_t n = 0; n < views.size(); ++n) {
    const auto ids = images.face_ids.subspan(n * kPlane, kPlane);
    std::ranges::transform(ids, alpha.begin(), [](auto id) { return id >= 0 ? 1.0f : 0.0f; });
    const auto color = images.color.subspan(3 * n * kPlane, 3 * kPlane);
    auto crop = CropOf({kSide, kSide, color, alpha}, seen.cameras[n]);
    if (crop) found.push_back({seen.cameras[n], std::move(*crop)});
  }
  return found;
}

double DirectionGap(const Camera& a, const Camera& b) {
  double dot = 0;
  for (int k = 6; k < 9; ++k) {
    dot += static_cast<double>(a.rotation[k]) * static_cast<double>(b.rotation[k]);
  }
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / std::numbers::pi;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/estimate.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <numeric>

#include "base/rng.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

constexpr int kLevel = 3;
constexpr float kRadius = 0.5f;
constexpr int kSide = 64;                // pixels of a look around
constexpr double kDistance = 1.6, kFov = 45;
constexpr int kAround = 24;              // viewpoints on the equator
constexpr double kLowest = -45, kHighest = 80, kElevationStep = 12.5;
constexpr double kPositionRate = 0.01, kColorRate = 0.03, kSmoothing = 6, kColorSmoothing = 0.5;

glm::dvec3 RowOf(const Camera& c, int r) {
  return {c.rotation[3 * r], c.rotation[3 * r + 1], c.rotation[3 * r + 2]};
}

}  // namespace

PoseEstimate::PoseEstimate(const PosePictures& pictures, const Workers& workers)
    : pictures_(pictures), workers_(workers), renderer_(workers) {
  scene_.cameras = pictures.lenses;
  placed_.resize(pictures.lenses.size());
  ForgetShape();
}

void PoseEstimate::ForgetShape() {
  const Mesh sphere = Icosphere(kLevel, kRadius);
  scene_.positions.clear(), scene_.faces.clear(), scene_.colors.clear();
  for (const glm::vec3& p : sphere.positions) {
    scene_.positions.insert(scene_.positions.end(), {p.x, p.y, p.z});
    scene_.colors.insert(scene_.colors.end(), pictures_.mean_color.begin(),
                         pictures_.mean_color.end());
  }
  for (const Face& f : sphere.faces) scene_.faces.insert(scene_.faces.end(), {f[0], f[1], f[2]});
}

void PoseEstimate::Place(int picture, const Camera& camera) {
  const auto i = static_cast<std::size_t>(picture);
  const Camera lens = pictures_.lenses[i];
  Camera& out = scene_.cameras[i];
  out = camera;
  out.fx = lens.fx, out.fy = lens.fy, out.cx = lens.cx, out.cy = lens.cy;
  placed_[i] = true;
}

std::vector<int> PoseEstimate::Placed() const {
  std::vector<int> out;
  for (int i = 0; i < static_cast<int>(placed_.size()); ++i) {
    if (is_placed(i)) out.push_back(i);
  }
  return out;
}

Result<double> PoseEstimate::Refit(const RefitOptions& o, std::span<const int> views) {
  FitterOptions options;
  options.parameters[Parameter::kPositions] = options.parameters[Parameter::kColors] = o.shape;
  options.parameters[Parameter::kCamera] = o.cameras;
  options.rates[Parameter::kPositions] = o.rate * kPositionRate;
  options.rates[Parameter::kColors] = o.rate * kColorRate;
  options.rates[Parameter::kCamera] = o.camera_rate;
  options.smoothing = kSmoothing, options.color_smoothing = kColorSmoothing;
  options.loss.silhouette_weight = o.silhouette_weight;
  options.loss.color_weight = o.color_weight * pictures_.color_weight;
  options.regularizers.laplacian = 0;
  TILEGRAD_ASSIGN(Fitter fitter, Fitter::Make(scene_, options, workers_));
  std::vector<int> order(views.begin(), views.end());
  const auto count = std::min(order.size(), static_cast<std::size_t>(o.views_per_step));
  Rng rng(7, static_cast<std::uint64_t>(++refits_));
  double sum = 0;
  int counted = 0;
  for (int i = 0; i < o.steps; ++i) {
    for (std::size_t k = 0; k < count; ++k) {
      std::swap(order[k], order[k + rng.Below(order.size() - k)]);
    }
    std::vector<int> chosen(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count));
    std::sort(chosen.begin(), chosen.end());
    FitStep step;
    step.views = chosen, step.targets = &pictures_.images;
    step.job.options.width = pictures_.images.width;
    step.job.options.height = pictures_.images.height;
    const double t = o.steps > 1 ? static_cast<double>(i) / (o.steps - 1) : 1;
    step.job.options.delta = o.delta_start * std::pow(o.delta_end / o.delta_start, t);
    step.job.options.max_alpha_error = 1e-3;
    step.rate_factor = 0.2 + 0.8 * 0.5 * (1 + std::cos(std::numbers::pi * t));
    TILEGRAD_ASSIGN(const FitValues values, fitter.Step(step));
    if (4 * i >= 3 * o.steps) sum += values.total, ++counted;
  }
  scene_ = fitter.scene();
  return counted > 0 ? sum / counted : 0;
}

Result<std::vector<double>> PoseEstimate::Losses(std::span<const int> views) {
  FitRenderer::Job job;
  job.views = views, job.alpha = false;
  job.options.width = pictures_.images.width, job.options.height = pictures_.images.height;
  TILEGRAD_TRY(renderer_.Render(scene_, job));
  const std::size_t plane = pictures_.images.pixels();
  std::vector<double> out;
  std::vector<float> alpha(plane);
  for (std::size_t n = 0; n < views.size(); ++n) {
    const Images& images = renderer_.images();
    for (std::size_t p = 0; p < plane; ++p) {
      alpha[p] = images.face_ids[n * plane + p] >= 0 ? 1.0f : 0.0f;
    }
    double both = 0, either = 0, gap = 0;
    const auto v = static_cast<std::size_t>(views[n]);
    for (std::size_t p = 0; p < plane; ++p) {
      const float a = pictures_.images.alpha[v * plane + p];
      both += std::min(a, alpha[p]), either += std::max(a, alpha[p]);
      if (alpha[p] == 0 || a == 0) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        gap += a * std::abs(images.color[(3 * n + c) * plane + p] -
                            pictures_.images.color[(3 * v + c) * plane + p]);
      }
    }
    out.push_back(1 - both / std::max(either, 1e-9) +
                  pictures_.color_weight * (both > 0 ? gap / (3 * both) : 1));
  }
  return out;
}

// Cameras that are held upright have their x axes across it: the least eigenvector of the sum of
// r r^T, by inverse iteration.
std::array<double, 3> PoseEstimate::Up() const {
  glm::dmat3 sum(1e-3);
  sum[1][1] = 0;  // y, as long as nothing else is known
  for (const int i : Placed()) {
    const glm::dvec3 r = RowOf(camera(i), 0);
    sum += glm::outerProduct(r, r);
  }
  sum += glm::dmat3(1e-6);
  glm::dvec3 up(0, 1, 0);
  const glm::dmat3 inverse = glm::inverse(sum);
  for (int k = 0; k < 50; ++k) up = glm::normalize(inverse * up);
  double sign = 0;
  for (const int i : Placed()) sign += glm::dot(RowOf(camera(i), 1), up);
  if (sign < 0) up = -up;
  return {up.x, up.y, up.z};
}

Result<std::vector<Viewpoint>> PoseEstimate::LookAround() {
  const auto u = Up();
  const glm::dvec3 up(u[0], u[1], u[2]);
  glm::dvec3 east = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
  east = glm::normalize(east - glm::dot(east, up) * up);
  const glm::dvec3 south = glm::cross(east, up);
  const Lens lens{kFov, kSide, kSide};
  std::vector<Viewpoint> found;
  FitScene scene = scene_;
  scene.cameras.clear();
  for (double e = kLowest; e <= kHighest + 1e-9; e += kElevationStep) {
    const double el = e * std::numbers::pi / 180;
    const int count = std::max(6, static_cast<int>(std::lround(kAround * std::cos(el))));
    for (int i = 0; i < count; ++i) {
      const double az = 2 * std::numbers::pi * i / count;
      const glm::dvec3 eye = kDistance * (std::cos(el) * (std::cos(az) * east + std::sin(az) * south) +
                                          std::sin(el) * up);
      const double from[3] = {eye.x, eye.y, eye.z}, target[3] = {0, 0, 0};
      scene.cameras.push_back(CameraCast<float>(LookAtCamera<double>(lens, from, target, u.data())));
    }
  }
  std::vector<int> views(scene.cameras.size());
  std::iota(views.begin(), views.end(), 0);
  FitRenderer::Job job;
  job.views = views, job.alpha = false;
  job.options.width = job.options.height = kSide;
  TILEGRAD_TRY(renderer_.Render(scene, job));
  const std::size_t plane = std::size_t{kSide} * kSide;
  std::vector<float> alpha(plane);
  for (std::size_t n = 0; n < views.size(); ++n) {
    for (std::size_t p = 0; p < plane; ++p) {
      alpha[p] = renderer_.images().face_ids[n * plane + p] >= 0 ? 1.0f : 0.0f;
    }
    const CropSource source{kSide, kSide,
                            std::span(renderer_.images().color).subspan(3 * n * plane, 3 * plane),
                            alpha};
    auto crop = CropOf(source, scene.cameras[n]);
    if (crop) found.push_back({scene.cameras[n], std::move(*crop)});
  }
  return found;
}

void PoseEstimate::Normalize() {
  glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  for (std::size_t i = 0; i < scene_.positions.size(); i += 3) {
    const glm::dvec3 p(scene_.positions[i], scene_.positions[i + 1], scene_.positions[i + 2]);
    low = glm::min(low, p), high = glm::max(high, p);
  }
  const glm::dvec3 middle = 0.5 * (low + high), extent = high - low;
  const double scale = 1 / std::max({extent.x, extent.y, extent.z, 1e-6});
  for (std::size_t i = 0; i < scene_.positions.size(); ++i) {
    scene_.positions[i] =
        static_cast<float>((static_cast<double>(scene_.positions[i]) - middle[static_cast<int>(i % 3)]) * scale);
  }
  for (const int i : Placed()) {
    Camera& c = scene_.cameras[static_cast<std::size_t>(i)];
    for (int r = 0; r < 3; ++r) {
      c.translation[r] = static_cast<float>(
          (static_cast<double>(c.translation[r]) + glm::dot(RowOf(c, r), middle)) * scale);
    }
  }
}

}  // namespace tilegrad::train

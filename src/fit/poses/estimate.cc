// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/estimate.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "base/error.h"
#include "base/rng.h"
#include "nn/optim.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

constexpr float kRadius = 0.5f;
constexpr std::size_t kViewsPerStep = 8;
// World units, colours and camera parameters a step.
constexpr double kPositionRate = 0.01, kColorRate = 0.03, kCameraRate = 0.008, kFinalRate = 0.2;
constexpr double kSmoothing = 6, kColorSmoothing = 0.5;  // as in refine.cc
// Softness of outlines, squared NDC: 1.4 and 0.55 pixels of 64.
constexpr double kDeltaStart = 2e-3, kDeltaEnd = 3e-4, kMaxAlphaError = 1e-3;

glm::dvec3 RowOf(const Camera& c, int r) {
  return {c.rotation[3 * r], c.rotation[3 * r + 1], c.rotation[3 * r + 2]};
}

// `count` different ones, in rising order.
std::vector<int> Choose(std::span<const int> from, std::size_t count, Rng* rng) {
  std::vector<int> order(from.begin(), from.end());
  count = std::min(count, order.size());
  for (std::size_t k = 0; k < count; ++k) {
    std::swap(order[k], order[k + rng->Below(order.size() - k)]);
  }
  order.resize(count);
  std::ranges::sort(order);
  return order;
}

FitterOptions OptionsOf(const RefitOptions& o, double color_weight) {
  FitterOptions out;
  out.parameters[Parameter::kPositions] = out.parameters[Parameter::kColors] = o.shape;
  out.parameters[Parameter::kCamera] = o.cameras;
  out.rates[Parameter::kPositions] = o.shape_rate * kPositionRate;
  out.rates[Parameter::kColors] = o.shape_rate * kColorRate;
  out.rates[Parameter::kCamera] = kCameraRate;
  out.smoothing = kSmoothing;
  out.color_smoothing = kColorSmoothing;
  out.loss.color_weight = color_weight;
  return out;
}

}  // namespace

PoseEstimate::PoseEstimate(const PosePictures& pictures, int level, const Workers& workers,
                           const Watch& watch)
    : pictures_(pictures), level_(level), workers_(workers), watch_(watch) {
  scene_.cameras = pictures.lenses;
  ForgetShape();
}

void PoseEstimate::ForgetShape() {
  FitScene fresh = SceneOfMesh(Icosphere(level_, kRadius)).value();
  for (std::size_t i = 0; i < fresh.colors.size(); ++i)
    fresh.colors[i] = pictures_.mean_color[i % 3];
  fresh.cameras = std::move(scene_.cameras);
  scene_ = std::move(fresh);
}

void PoseEstimate::Place(std::size_t picture, const Camera& camera) {
  const Camera lens = pictures_.lenses[picture];
  Camera& out = scene_.cameras[picture];
  out = camera;
  out.fx = lens.fx;
  out.fy = lens.fy;
  out.cx = lens.cx;
  out.cy = lens.cy;
  out.near_plane = lens.near_plane;
}

FitStep PoseEstimate::StepAt(double t) const {
  FitStep step;
  step.targets = &pictures_.images;
  step.job.options.width = pictures_.images.width;
  step.job.options.height = pictures_.images.height;
  step.job.options.delta = nn::Geometric(kDeltaStart, kDeltaEnd, t);
  step.job.options.max_alpha_error = kMaxAlphaError;
  step.rate_factor = nn::HalfCosine(kFinalRate, t);
  return step;
}

Status PoseEstimate::Tell(const RefitOptions& o, int step) const {
  if (o.told == 0 && watch_.stopped()) return Cancelled("stopped while looking for cameras");
  if (o.told == 0) return {};
  return watch_.At({"refining cameras", static_cast<std::uint64_t>(o.first + step),
                    static_cast<std::uint64_t>(o.told), ""});
}

Result<double> PoseEstimate::Refit(const RefitOptions& o, std::span<const int> pictures) {
  TILEGRAD_ASSIGN(const auto fitter,
                  Fitter::Make(scene_, OptionsOf(o, pictures_.color_weight), workers_));
  Rng rng(0, ++refits_);
  double sum = 0;
  int counted = 0;
  for (int i = 0; i < o.steps; ++i) {
    TILEGRAD_TRY(Tell(o, i));
    const std::vector<int> views = Choose(pictures, kViewsPerStep, &rng);
    FitStep step = StepAt(static_cast<double>(i) / o.steps);
    step.views = views;
    TILEGRAD_ASSIGN(const FitValues values, fitter->Step(step));
    if (4 * i >= 3 * o.steps) {
      sum += values.loss;
      ++counted;
    }
  }
  scene_ = fitter->scene();
  return counted > 0 ? sum / counted : 0;
}

// The least eigenvector of the sum of x x^T over the cameras' axes, by inverse iteration.
std::array<double, 3> PoseEstimate::Up() const {
  glm::dmat3 sum(1e-6);
  for (const Camera& c : scene_.cameras) {
    const glm::dvec3 x = RowOf(c, 0);
    sum += glm::outerProduct(x, x);
  }
  const glm::dmat3 inverse = glm::inverse(sum);
  glm::dvec3 up(0.01, 1, 0.02), mean(0);
  for (int k = 0; k < 50; ++k) up = glm::normalize(inverse * up);
  for (const Camera& c : scene_.cameras) mean += RowOf(c, 1);
  if (glm::dot(mean, up) < 0) up = -up;
  return {up.x, up.y, up.z};
}

void PoseEstimate::Normalize() {
  glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  std::vector<float>& p = scene_.positions;
  for (std::size_t i = 0; i < p.size(); i += 3) {
    low = glm::min(low, glm::dvec3(p[i], p[i + 1], p[i + 2]));
    high = glm::max(high, glm::dvec3(p[i], p[i + 1], p[i + 2]));
  }
  const glm::dvec3 middle = 0.5 * (low + high), extent = high - low;
  const double scale = 1 / std::max({extent.x, extent.y, extent.z, 1e-6});
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double moved = static_cast<double>(p[i]) - middle[static_cast<int>(i % 3)];
    p[i] = static_cast<float>(scale * moved);
  }
  for (Camera& c : scene_.cameras) {
    for (int r = 0; r < 3; ++r) {
      const double moved = static_cast<double>(c.translation[r]) + glm::dot(RowOf(c, r), middle);
      c.translation[r] = static_cast<float>(scale * moved);
    }
  }
}

}  // namespace tilegrad::train

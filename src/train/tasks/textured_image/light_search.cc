// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/light_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace tilegrad::train {
namespace {

using Direction = std::array<double, 3>;

constexpr int kDirections = 160;            // some 11 degrees apart on a hemisphere
constexpr int kRings = 3;                   // finer and finer around the best
constexpr int kAround = 8;                  // directions of a ring
constexpr double kFirstRing = 0.1;          // radians; each is half of the one before
constexpr double kLeastOutlineCover = 0.5;  // outlines say nothing about light
constexpr std::size_t kFewest = 16;         // pixels

struct LitPixel {
  std::array<double, 3> normal, texture, picture;
};

double DotOf(const Direction& a, const Direction& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Direction UnitOf(const Direction& d) {
  const double length = std::sqrt(DotOf(d, d));
  return {d[0] / length, d[1] / length, d[2] / length};
}

// Normals turned to the camera's axes.
template <class T>
std::vector<LitPixel> Samples(const LightEvidence<T>& e, std::span<const float, 9> r) {
  const std::size_t pixels = e.cover.size();
  std::vector<LitPixel> out;
  for (std::size_t p = 0; p < pixels; ++p) {
    const Direction n = {double(e.normals[p]), double(e.normals[pixels + p]),
                         double(e.normals[2 * pixels + p])};
    if (double(e.cover[p]) < kLeastOutlineCover || DotOf(n, n) < 0.5) continue;
    LitPixel sample;
    for (std::size_t c = 0; c < 3; ++c) {
      sample.normal[c] =
          double{r[3 * c]} * n[0] + double{r[3 * c + 1]} * n[1] + double{r[3 * c + 2]} * n[2];
      sample.texture[c] = double(e.texture[c * pixels + p]);
      sample.picture[c] = double(e.picture[c * pixels + p]);
    }
    out.push_back(sample);
  }
  return out;
}

// SkyAndLight without a sky, of a surface with the cosine `t` to the direction: pi, 2 pi / 3 and
// pi / 4 times 1 / 4 pi, 3 t / 4 pi and 5 (3 t^2 - 1) / 8 pi.
double FromDirection(double t) { return 0.25 + 0.5 * t + 5.0 / 32 * (3 * t * t - 1); }

}  // namespace

// The best light so far of one picture.
class LightSearch::Attempts {
 public:
  Attempts(const LightSearch& search, std::vector<LitPixel> samples)
      : search_(search), samples_(std::move(samples)) {}

  void Try(const Direction& direction) {
    const FoundLight light{direction, search_.has_sky_ ? BestSky(direction) : 0};
    const double error = Error(light);
    if (error < least_) {
      least_ = error;
      best_ = light;
    }
  }
  // The directions around the best one.
  void TryRing(double radius) {
    const Direction center = best_.direction;
    const Direction a = UnitOf(std::abs(center[2]) < 0.9 ? Direction{center[1], -center[0], 0}
                                                         : Direction{0, center[2], -center[1]});
    const Direction b = {center[1] * a[2] - center[2] * a[1], center[2] * a[0] - center[0] * a[2],
                         center[0] * a[1] - center[1] * a[0]};
    for (int k = 0; k < kAround; ++k) {
      const double x = radius * std::cos(2 * std::numbers::pi * k / kAround);
      const double y = radius * std::sin(2 * std::numbers::pi * k / kAround);
      const Direction d = UnitOf({center[0] + x * a[0] + y * b[0], center[1] + x * a[1] + y * b[1],
                                  center[2] + x * a[2] + y * b[2]});
      if (d[2] >= search_.cosine_ - 1e-9) Try(d);
    }
  }
  const FoundLight& best() const { return best_; }

 private:
  // By least squares: the picture is linear in it.
  double BestSky(const Direction& direction) const {
    double above = 0, below = 0;
    for (const LitPixel& s : samples_) {
      const double lit = FromDirection(DotOf(s.normal, direction));
      for (std::size_t c = 0; c < 3; ++c) {
        const double slope = (1 - lit) * s.texture[c];
        above += slope * (s.picture[c] - lit * s.texture[c]);
        below += slope * slope;
      }
    }
    const double low = search_.config_.sky_low, high = search_.config_.sky_high;
    return below > 0 ? std::clamp(above / below, low, high) : low;
  }

  double Error(const FoundLight& light) const {
    double sum = 0;
    for (const LitPixel& s : samples_) {
      const double t = DotOf(s.normal, light.direction);
      const double lit = search_.has_sky_ ? light.sky + (1 - light.sky) * FromDirection(t)
                                          : search_.config_.ambient + std::max(0.0, t);
      for (std::size_t c = 0; c < 3; ++c)
        sum += std::abs(std::min(1.0, lit * s.texture[c]) - s.picture[c]);
    }
    return sum;
  }

  const LightSearch& search_;
  const std::vector<LitPixel> samples_;
  FoundLight best_;
  double least_ = std::numeric_limits<double>::infinity();
};

// Fibonacci's lattice: equal areas, turned by the golden angle.
LightSearch::LightSearch(const LightConfig& config)
    : config_(config),
      has_sky_(LightingOf(config) == Lighting::kSphericalHarmonics),
      cosine_(std::cos(WidestAngle(config) * std::numbers::pi / 180)) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int k = 0; k < kDirections; ++k) {
    const double z = 1 - (1 - cosine_) * (k + 0.5) / kDirections;
    const double side = std::sqrt(std::max(0.0, 1 - z * z));
    directions_.push_back({side * std::cos(golden * k), side * std::sin(golden * k), z});
  }
}

template <class T>
FoundLight LightSearch::Find(const LightEvidence<T>& evidence,
                             std::span<const float, 9> rotation) const {
  std::vector<LitPixel> samples = Samples(evidence, rotation);
  if (samples.size() < kFewest) return {};
  Attempts attempts(*this, std::move(samples));
  for (const Direction& d : directions_) attempts.Try(d);
  double radius = kFirstRing;
  for (int ring = 0; ring < kRings; ++ring, radius /= 2) attempts.TryRing(radius);
  return attempts.best();
}

template FoundLight LightSearch::Find(const LightEvidence<float>&, std::span<const float, 9>) const;
template FoundLight LightSearch::Find(const LightEvidence<double>&,
                                      std::span<const float, 9>) const;

}  // namespace tilegrad::train

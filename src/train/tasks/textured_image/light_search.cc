// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/light_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tilegrad::train {
namespace {

using Direction = std::array<double, 3>;

constexpr int kDirections = 160;     // some 11 degrees apart on a hemisphere
constexpr int kRings = 3;            // finer and finer around the best
constexpr int kAround = 8;           // directions of a ring
constexpr double kFirstRing = 0.1;   // radians; each is half of the one before
constexpr double kLeastCover = 0.5;  // outlines say nothing about light
constexpr std::size_t kFewest = 16;  // pixels

struct Sample {
  std::array<double, 3> normal, texture, picture;
};

double Dot(const Direction& a, const Direction& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Direction Unit(const Direction& d) {
  const double length = std::sqrt(Dot(d, d));
  return {d[0] / length, d[1] / length, d[2] / length};
}

// Normals turned to the camera's axes.
template <class T>
std::vector<Sample> Samples(const LightEvidence<T>& e, std::span<const float, 9> r) {
  const std::size_t pixels = e.cover.size();
  std::vector<Sample> out;
  for (std::size_t p = 0; p < pixels; ++p) {
    const Direction n = {double(e.normals[p]), double(e.normals[pixels + p]),
                         double(e.normals[2 * pixels + p])};
    if (double(e.cover[p]) < kLeastCover || Dot(n, n) < 0.5) continue;
    Sample sample;
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

double Error(const std::vector<Sample>& samples, const Direction& light, double ambient) {
  double sum = 0;
  for (const Sample& s : samples) {
    const double lit = ambient + std::max(0.0, Dot(s.normal, light));
    for (std::size_t c = 0; c < 3; ++c)
      sum += std::abs(std::min(1.0, lit * s.texture[c]) - s.picture[c]);
  }
  return sum;
}

}  // namespace

// Fibonacci's lattice: equal areas, turned by the golden angle.
LightSearch::LightSearch(double spread, double ambient)
    : cosine_(std::cos(spread * std::numbers::pi / 180)), ambient_(ambient) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int k = 0; k < kDirections; ++k) {
    const double z = 1 - (1 - cosine_) * (k + 0.5) / kDirections;
    const double side = std::sqrt(std::max(0.0, 1 - z * z));
    directions_.push_back({side * std::cos(golden * k), side * std::sin(golden * k), z});
  }
}

template <class T>
std::array<double, 3> LightSearch::Find(const LightEvidence<T>& evidence,
                                        std::span<const float, 9> rotation) const {
  const std::vector<Sample> samples = Samples(evidence, rotation);
  if (samples.size() < kFewest) return {};
  Direction best = {};
  double least = std::numeric_limits<double>::infinity();
  const auto attempt = [&](const Direction& d) {
    const double error = Error(samples, d, ambient_);
    if (error < least) least = error, best = d;
  };
  for (const Direction& d : directions_) attempt(d);
  double radius = kFirstRing;
  for (int ring = 0; ring < kRings; ++ring, radius /= 2) {
    const Direction center = best;
    const Direction a = Unit(std::abs(center[2]) < 0.9 ? Direction{center[1], -center[0], 0}
                                                       : Direction{0, center[2], -center[1]});
    const Direction b = {center[1] * a[2] - center[2] * a[1], center[2] * a[0] - center[0] * a[2],
                         center[0] * a[1] - center[1] * a[0]};
    for (int k = 0; k < kAround; ++k) {
      const double x = radius * std::cos(2 * std::numbers::pi * k / kAround);
      const double y = radius * std::sin(2 * std::numbers::pi * k / kAround);
      const Direction d = Unit({center[0] + x * a[0] + y * b[0], center[1] + x * a[1] + y * b[1],
                                center[2] + x * a[2] + y * b[2]});
      if (d[2] >= cosine_ - 1e-9) attempt(d);
    }
  }
  return best;
}

template std::array<double, 3> LightSearch::Find(const LightEvidence<float>&,
                                                 std::span<const float, 9>) const;
template std::array<double, 3> LightSearch::Find(const LightEvidence<double>&,
                                                 std::span<const float, 9>) const;

}  // namespace tilegrad::train

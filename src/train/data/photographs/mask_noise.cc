// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>

#include "train/data/photographs/distance_barrier.h"
#include "train/data/photographs/rendered_set.h"

namespace tilegrad::train {
namespace {

// A sum of waves, of unit variance.
class SmoothNoise {
 public:
  explicit SmoothNoise(Rng& rng) {
    for (Wave& wave : waves_) {
      const double turn = rng.Uniform(0, 2 * std::numbers::pi), length = rng.Uniform(12, 50);
      wave = {2 * std::numbers::pi * std::cos(turn) / length,
              2 * std::numbers::pi * std::sin(turn) / length, rng.Uniform(0, 2 * std::numbers::pi)};
    }
  }
  double At(int x, int y) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += std::cos(wave.x * x + wave.y * y + wave.phase);
    return sum * std::sqrt(2.0 / static_cast<double>(waves_.size()));
  }

 private:
  struct Wave {
    double x, y, phase;
  };
  std::array<Wave, 8> waves_;
};

// Distances are of squares: the mask in the upper left corner of one.
std::vector<float> InSquare(const PhotoMask& mask, int side) {
  std::vector<float> out(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0.0f);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x)
      out[static_cast<std::size_t>(y * side + x)] = mask.at(x, y) ? 1.0f : 0.0f;
  }
  return out;
}

}  // namespace

PhotoMask DisturbedMask(const PhotoMask& mask, double deviation, Rng& rng) {
  const int side = std::max(mask.width, mask.height);
  const std::vector<float> square = InSquare(mask, side);
  const auto to_object = SquaredDistances(square, side, true),
             to_rest = SquaredDistances(square, side, false);
  const double shift = deviation * rng.Normal() / 2;
  const SmoothNoise noise(rng);
  PhotoMask out = mask;
  bool any = false;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      const auto i = static_cast<std::size_t>(y * side + x);
      const double outside = std::sqrt(to_object[i]) - std::sqrt(to_rest[i]);
      const bool inside = outside < shift + deviation * noise.At(x, y);
      out.inside[static_cast<std::size_t>(y) * static_cast<std::size_t>(mask.width) +
                 static_cast<std::size_t>(x)] = inside;
      any = any || inside;
    }
  }
  return any ? out : mask;
}

}  // namespace tilegrad::train

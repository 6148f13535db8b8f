// SPDX-License-Identifier: Apache-2.0
// Pictures of a painted ball under known lights, whose directions are found again.
#include "train/tasks/textured_image/light_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/camera.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {
namespace {

constexpr int kSize = 32;
constexpr std::size_t kPixels = std::size_t{kSize} * kSize;
using Direction = std::array<float, 3>;

struct Ball {
  std::vector<double> texture = std::vector<double>(3 * kPixels), normals = texture,
                      picture = texture, cover = std::vector<double>(kPixels);

  // As a camera at infinity sees it; `light` in its axes.
  Ball(const Direction& light, double ambient, std::span<const float, 9> rotation) {
    for (int p = 0; p < kSize * kSize; ++p) {
      const double x = (p % kSize - 15.5) / 15, y = -(p / kSize - 15.5) / 15,
                   rest = 1 - x * x - y * y;
      if (rest > 0)
        Fill(static_cast<std::size_t>(p), {x, y, std::sqrt(rest)}, light, ambient, rotation);
    }
  }
  LightEvidence<double> evidence() const { return {texture, normals, picture, cover}; }

 private:
  void Fill(std::size_t p, const std::array<double, 3>& n, const Direction& light, double ambient,
            std::span<const float, 9> r) {
    const double lit = ambient + std::max(0.0, n[0] * double{light[0]} + n[1] * double{light[1]} +
                                                   n[2] * double{light[2]});
    cover[p] = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = c * kPixels + p;
      texture[at] = 0.5 + 0.4 * std::sin(5 * n[0] + 3 * static_cast<double>(c));
      picture[at] = std::min(1.0, lit * texture[at]);
      normals[at] = double{r[c]} * n[0] + double{r[3 + c]} * n[1] + double{r[6 + c]} * n[2];
    }
  }
};

// Lattice and rings leave some 1.5 degrees, the ball's pixels another; at the edge of the
// hemisphere a third of the ball's outline is all that is lit.
TEST(LightSearch, FindsTheLight) {
  const Camera camera = OrbitCamera<float>({}, 70, 25, 1.6);
  for (const double ambient : {0.0, 0.2}) {
    const LightSearch search(90, ambient);
    for (int k = 0; k < 24; ++k) {
      const double tilt = 1.5 * (k + 0.5) / 24, turn = 2.4 * k;
      const Direction light = {static_cast<float>(std::sin(tilt) * std::cos(turn)),
                               static_cast<float>(std::sin(tilt) * std::sin(turn)),
                               static_cast<float>(std::cos(tilt))};
      const Ball ball(light, ambient, camera.rotation);
      const auto found = search.Find(ball.evidence(), camera.rotation);
      const Direction f = {static_cast<float>(found[0]), static_cast<float>(found[1]),
                           static_cast<float>(found[2])};
      EXPECT_LT(AngleBetween(f, light), 3) << "light " << k << ", ambient " << ambient;
    }
  }
}

TEST(LightSearch, StaysInItsCapAndSaysNothingOfNothing) {
  const Camera camera = OrbitCamera<float>({}, 0, 0, 1.6);
  const LightSearch search(30, 0);
  Ball ball({0.8f, 0, 0.6f}, 0, camera.rotation);
  EXPECT_GE(search.Find(ball.evidence(), camera.rotation)[2], std::cos(0.5236) - 1e-6);
  std::fill(ball.cover.begin(), ball.cover.end(), 0.0);
  EXPECT_EQ(search.Find(ball.evidence(), camera.rotation), (std::array<double, 3>{}));
}

}  // namespace
}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Pictures of a painted ball under known lights, whose directions are found again.
#include "train/tasks/textured_image/light_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/camera.h"
#include "scene/light_frame.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train::light_search_test {

constexpr int kSize = 32;
constexpr std::size_t kPixels = std::size_t{kSize} * kSize;
using Direction = std::array<float, 3>;

struct Ball {
  std::vector<double> texture = std::vector<double>(3 * kPixels), normals = texture,
                      picture = texture, cover = std::vector<double>(kPixels);

  // As a camera at infinity sees it. `law`: the light at a normal in its axes.
  template <class Law>
  Ball(const Law& law, std::span<const float, 9> rotation) {
    for (int p = 0; p < kSize * kSize; ++p) {
      const double x = (p % kSize - 15.5) / 15, y = -(p / kSize - 15.5) / 15,
                   rest = 1 - x * x - y * y;
      if (rest > 0) Fill(static_cast<std::size_t>(p), {x, y, std::sqrt(rest)}, law, rotation);
    }
  }
  LightEvidence<double> evidence() const { return {texture, normals, picture, cover}; }

 private:
  template <class Law>
  void Fill(std::size_t p, const std::array<double, 3>& n, const Law& law,
            std::span<const float, 9> r) {
    const double lit = law(n);
    cover[p] = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = c * kPixels + p;
      texture[at] = 0.5 + 0.4 * std::sin(5 * n[0] + 3 * static_cast<double>(c));
      picture[at] = std::min(1.0, lit * texture[at]);
      normals[at] = double{r[c]} * n[0] + double{r[3 + c]} * n[1] + double{r[6 + c]} * n[2];
    }
  }
};

LightConfig Light(double spread, double ambient) {
  LightConfig config;
  config.spread = spread;
  config.ambient = ambient;
  return config;
}

auto Lambert(const Direction& light, double ambient) {
  return [=](const std::array<double, 3>& n) {
    return ambient + std::max(0.0, n[0] * double{light[0]} + n[1] * double{light[1]} +
                                       n[2] * double{light[2]});
  };
}

// Some of all lights within 1.5 radians of the camera's axis.
Direction LightAt(int k, int count) {
  const double tilt = 1.5 * (k + 0.5) / count, turn = 2.4 * k;
  return {static_cast<float>(std::sin(tilt) * std::cos(turn)),
          static_cast<float>(std::sin(tilt) * std::sin(turn)), static_cast<float>(std::cos(tilt))};
}

Direction AsFloat(const std::array<double, 3>& d) {
  return {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])};
}

// Lattice and rings leave some 1.5 degrees, the ball's pixels another; at the edge of the
// hemisphere a third of the ball's outline is all that is lit.
TEST(LightSearch, FindsTheLight) {
  const Camera camera = OrbitCamera<float>({}, 70, 25, 1.6);
  for (const double ambient : {0.0, 0.2}) {
    const LightSearch search(Light(90, ambient));
    for (int k = 0; k < 24; ++k) {
      const Direction light = LightAt(k, 24);
      const Ball ball(Lambert(light, ambient), camera.rotation);
      const Direction found = AsFloat(search.Find(ball.evidence(), camera.rotation).direction);
      EXPECT_LT(AngleBetween(found, light), 3) << "light " << k << ", ambient " << ambient;
    }
  }
}

// A direction that is 2 degrees off moves the sky, too.
TEST(LightSearch, FindsSkyAndDirectionOfHarmonics) {
  const Camera camera = OrbitCamera<float>({}, -40, 10, 1.6);
  LightConfig config;
  config.model = "harmonics";
  const LightSearch search(config);
  for (int k = 0; k < 12; ++k) {
    const Direction light = LightAt(k, 12);
    const double sky = config.sky_low + (config.sky_high - config.sky_low) * k / 11;
    const std::array<float, 9> sh = SkyAndLight(sky, light);
    const auto law = [&](const std::array<double, 3>& n) {
      const std::array<double, 9> basis = HarmonicBasis(n);
      double lit = 0;
      for (std::size_t i = 0; i < 9; ++i) lit += double{sh[i]} * basis[i];
      return lit;
    };
    const Ball ball(law, camera.rotation);
    const FoundLight found = search.Find(ball.evidence(), camera.rotation);
    EXPECT_LT(AngleBetween(AsFloat(found.direction), light), 4) << "light " << k;
    EXPECT_NEAR(found.sky, sky, 0.02) << "light " << k;
  }
}

TEST(LightSearch, StaysInItsCapAndSaysNothingOfNothing) {
  const Camera camera = OrbitCamera<float>({}, 0, 0, 1.6);
  const LightSearch search(Light(30, 0));
  Ball ball(Lambert({0.8f, 0, 0.6f}, 0), camera.rotation);
  EXPECT_GE(search.Find(ball.evidence(), camera.rotation).direction[2], std::cos(0.5236) - 1e-6);
  std::fill(ball.cover.begin(), ball.cover.end(), 0.0);
  EXPECT_EQ(search.Find(ball.evidence(), camera.rotation).direction, (std::array<double, 3>{}));
}

}  // namespace tilegrad::train::light_search_test

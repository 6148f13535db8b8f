// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "shade/lambert_ref.h"

namespace tilegrad::shade::lambert_test {

using Complex = std::complex<double>;
constexpr double kStep = 1e-30;

template <class T>
std::array<LightT<T>, 2> Lights() {
  return {LightT<T>{{T(0), T(1), T(0)}, T(0.5)}, LightT<T>{{T(0.6), T(0), T(0.8)}, T(0.25)}};
}

TEST(Lambert, FacingLightAddsItsIntensityAndAvertedOneNothing) {
  const auto lights = Lights<double>();
  const LambertLightT<double> light{0.3, lights};
  EXPECT_DOUBLE_EQ(LambertRef<double>(light, {0, 1, 0}), 0.8);
  EXPECT_DOUBLE_EQ(LambertRef<double>(light, {0, -1, 0}), 0.3);
  EXPECT_DOUBLE_EQ(LambertRef<double>(light, {0.6, 0, 0.8}), 0.55);
}

TEST(Lambert, AdjointIsTheComplexStepDerivative) {
  const auto lights = Lights<double>();
  const std::array<double, 3> n = {0.48, 0.6, 0.64};
  std::array<double, 3> d_n = {};
  std::array<LightT<double>, 2> d_lights = {kNoLight<double>, kNoLight<double>};
  LambertAdjointRef<double>({0.3, lights}, n, 1.7, d_n, d_lights);

  const auto step = [&](auto move) {
    auto z_lights = Lights<Complex>();
    std::array<Complex, 3> z = {n[0], n[1], n[2]};
    move(z, z_lights);
    return 1.7 * LambertRef<Complex>({Complex(0.3), z_lights}, z).imag() / kStep;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(d_n[i], step([&](auto& z, auto&) { z[i] += Complex(0, kStep); }), 1e-15);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(d_lights[k].direction[i],
                  step([&](auto&, auto& l) { l[k].direction[i] += Complex(0, kStep); }), 1e-15);
    }
  }
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(d_lights[k].intensity,
                step([&](auto&, auto& l) { l[k].intensity += Complex(0, kStep); }), 1e-15);
  }
}

TEST(Lambert, AvertedLightPullsNothing) {
  const auto lights = Lights<double>();
  std::array<double, 3> d_n = {};
  LambertAdjointRef<double>({0.3, lights}, {-0.6, -0.8, 0}, 1.0, d_n, {});
  for (double d : d_n) EXPECT_EQ(d, 0.0);
}

}  // namespace tilegrad::shade::lambert_test

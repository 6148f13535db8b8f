// SPDX-License-Identifier: Apache-2.0
// The adjoint of a camera's parameters against a complex step through them and the projection of a
// point. Tolerance: a complex step has no truncation error; both sides are some 100 roundings of
// terms up to the largest entry of the gradient's own terms: 1e-12 of it.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <functional>
#include <limits>

#include "base/rng.h"
#include "raster/project_ref.h"
#include "scene/camera_ref.h"
#include "scene/lens_distortion.h"
#include "support/temp_folder.h"

namespace tilegrad::camera_parameters_test {

using Complex = std::complex<double>;
using P64 = CameraParametersT<double>;
using PC = CameraParametersT<Complex>;

constexpr double kNear = 0.1;

template <class T, class P>
auto Entries(P& p) {
  std::vector<std::reference_wrapper<T>> out;
  for (auto& x : p.rotation) out.push_back(std::ref(x));
  for (auto& x : p.translation) out.push_back(std::ref(x));
  for (auto* x : {&p.fx, &p.fy, &p.cx, &p.cy}) out.push_back(std::ref(*x));
  return out;
}

// A random loss: weights of the pixel and of every entry of the camera, so that all count.
template <class T>
T Loss(const CameraParametersT<T>& p, const std::array<double, 3>& point,
       const std::array<double, 11>& w) {
  const CameraT<T> camera = CameraFromParametersRef(p, T(kNear));
  const T position[3] = {T(point[0]), T(point[1]), T(point[2])};
  const auto at = raster::ToCamera(camera, position);
  T loss = w[0] * (camera.cx + camera.fx * at.x / at.depth) +
           w[1] * (camera.cy - camera.fy * at.y / at.depth);
  for (int i = 0; i < 9; ++i) loss += w[2 + i] * camera.rotation[i];
  return loss;
}

CameraT<double> CameraAdjoint(const P64& p, const std::array<double, 3>& point,
                              const std::array<double, 11>& w) {
  const CameraT<double> camera = CameraFromParametersRef(p, kNear);
  CameraT<double> d_camera = raster::ZeroCamera<double>();
  raster::CameraPoint<double> d_point{0, 0, 0};
  double d_position[3] = {};
  raster::PerspectiveBackward(raster::ToCamera(camera, point.data()), w[0], w[1], 0.0, camera,
                              &d_point, &d_camera);
  raster::ToCameraBackward(camera, point.data(), d_point, d_position, &d_camera);
  for (int i = 0; i < 9; ++i) d_camera.rotation[i] += w[2 + i];
  return d_camera;
}

TEST(CameraParameters, AdjointIsTheComplexStep) {
  Rng rng(3);
  const auto random = [&] { return 2.0 * rng.Uniform() - 1; };
  for (int trial = 0; trial < 1000; ++trial) {
    P64 p;
    for (double& x : p.rotation) x = random();
    p.translation[0] = random();
    p.translation[1] = random();
    p.translation[2] = -3;
    p.fx = 100 + 50 * random();
    p.fy = 100 + 50 * random();
    p.cx = 32;
    p.cy = 24;
    std::array<double, 3> point = {random(), random(), random()};
    std::array<double, 11> w;
    for (double& x : w) x = random();
    P64 d;
    CameraFromParametersAdjointRef(p, CameraAdjoint(p, point, w), &d);
    PC step;
    std::copy_n(p.rotation, 6, step.rotation);
    std::copy_n(p.translation, 3, step.translation);
    step.fx = p.fx;
    step.fy = p.fy;
    step.cx = p.cx;
    step.cy = p.cy;
    const auto entries = Entries<Complex>(step);
    const auto gradient = Entries<double>(d);
    ASSERT_EQ(entries.size(), 13u);
    double largest = 0;
    for (const double g : gradient) largest = std::max(largest, std::abs(g));
    for (std::size_t i = 0; i < entries.size(); ++i) {
      Complex& x = entries[i];
      x += Complex(0, 1e-30);
      EXPECT_NEAR(Loss(step, point, w).imag() / 1e-30, gradient[i], 1e-12 * largest) << i;
      x = x.real();
    }
  }
}

TEST(CameraParameters, WhatGivesNoRotationIsRefused) {
  CameraParameters p{.rotation = {1, 2, 3, 2, 4, 6}};
  ExpectMessage(CameraFromParameters(p, 0.1f).status(), "parallel");
  p = {.rotation = {0, 0, 0, 0, 1, 0}};
  ExpectMessage(CameraFromParameters(p, 0.1f).status(), "rotation");
  p = {.rotation = {1, 0, 0, 0, 0, 0}};
  ExpectMessage(CameraFromParameters(p, 0.1f).status(), "rotation");
  p.rotation[0] = std::numeric_limits<float>::infinity();
  ExpectMessage(CameraFromParameters(p, 0.1f).status(), "finite");
  p = {};
  p.fx = -1;
  ExpectMessage(CameraFromParameters(p, 0.1f).status(), "focal");
  ExpectMessage(CameraFromParameters({}, 0).status(), "near plane");
}

TEST(LensDistortion, BendsAsItsFormulaSays) {
  // Every coefficient alone, at a place whose r^2 is 0.25.
  const Vec2Array at = {0.3, 0.4};
  const auto brown = [&](std::size_t which, double x, double y) {
    std::array<double, 8> k = {};
    k[which] = 0.1;
    const Vec2Array bent = Bent(BrownLens(k), at);
    EXPECT_NEAR(bent[0], x, 1e-12) << which;
    EXPECT_NEAR(bent[1], y, 1e-12) << which;
  };
  brown(0, 0.3 * 1.025, 0.4 * 1.025);                             // k1 r^2
  brown(1, 0.3 * 1.00625, 0.4 * 1.00625);                         // k2 r^4
  brown(4, 0.3 * 1.0015625, 0.4 * 1.0015625);                     // k3 r^6
  brown(5, 0.3 / 1.025, 0.4 / 1.025);                             // k4, below the line
  brown(2, 0.3 + 2 * 0.1 * 0.12, 0.4 + 0.1 * (0.25 + 2 * 0.16));  // p1
  brown(3, 0.3 + 0.1 * (0.25 + 2 * 0.09), 0.4 + 2 * 0.1 * 0.12);  // p2
  const double angle = std::atan(0.5);
  const Vec2Array plain = Bent(FisheyeLens({0, 0, 0, 0}), at);
  EXPECT_NEAR(std::hypot(plain[0], plain[1]), angle, 1e-12);
  const Vec2Array bent = Bent(FisheyeLens({0.1, 0, 0, 0.2}), at);
  EXPECT_NEAR(bent[1] / 0.8, angle * (1 + 0.1 * angle * angle + 0.2 * std::pow(angle, 8)), 1e-12);
  EXPECT_TRUE(BrownLens({}).straight());
  EXPECT_FALSE(FisheyeLens({0, 0, 0, 0}).straight());
}

TEST(LensDistortion, IsUndoneWithinTheRadiusWhereItCanBe) {
  const LensDistortion lenses[] = {BrownLens({-0.3, 0.08, 0.01, -0.008, 0.002, 0, 0, 0}),
                                   BrownLens({0.2, 0.1, 0, 0.004, 0, 0.05, 0, 0}),
                                   FisheyeLens({0.05, -0.01, 0.003, -0.001})};
  for (const LensDistortion& lens : lenses) {
    const double largest = LargestRadius(lens);
    EXPECT_GT(largest, 0.9);
    for (double angle = 0.1; angle < 6.3; angle += 0.5) {
      for (const double radius : {0.0, 0.2, 0.5, 0.8}) {
        const Vec2Array at = {radius * std::cos(angle), radius * std::sin(angle)};
        const auto back = Unbent(lens, Bent(lens, at), largest);
        ASSERT_TRUE(back.has_value());
        EXPECT_NEAR((*back)[0], at[0], 1e-7);
        EXPECT_NEAR((*back)[1], at[1], 1e-7);
      }
    }
  }
}

// r (1 - 0.3 r^2) turns back where its derivative, 1 - 0.9 r^2, is 0.
TEST(LensDistortion, EndsWherePolynomialsTurnBack) {
  const LensDistortion lens = BrownLens({-0.3, 0, 0, 0, 0, 0, 0, 0});
  const double largest = LargestRadius(lens);
  EXPECT_NEAR(largest, std::sqrt(1 / 0.9), 0.01);
  EXPECT_FALSE(Unbent(lens, {0.9, 0}, largest).has_value());  // beyond 0.703, what it reaches
  for (const double wild : {1e300, -1e300, 1e-320})
    EXPECT_TRUE(std::isfinite(LargestRadius(BrownLens({wild, wild, wild, 0, 0, 0, 0, 0}))));
}

}  // namespace tilegrad::camera_parameters_test

// SPDX-License-Identifier: Apache-2.0
// The adjoint of a camera's parameters against a complex step through them and the projection of a
// point. Tolerance: a complex step has no truncation error; both sides are some 100 roundings of
// terms up to the largest entry of the gradient's own terms: 1e-12 of it.
#include <gtest/gtest.h>

#include <complex>
#include <functional>
#include <limits>

#include "base/rng.h"
#include "raster/project_ref.h"
#include "scene/camera_ref.h"
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

TEST(CameraParameters, GiveARotationAndComeBack) {
  const Camera camera = OrbitCamera({}, 25, 40, 3);
  const auto back = CameraFromParameters(ParametersOf(camera), camera.near_plane);
  ASSERT_TRUE(back.ok()) << back.status().message();
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(back->rotation[i], camera.rotation[i], 2e-7);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(back->translation[i], camera.translation[i]);
  EXPECT_EQ(back->fx, camera.fx);
}

TEST(CameraParameters, PullBackIsTheReference) {
  CameraParameters p = ParametersOf(OrbitCamera({}, 25, 40, 3));
  p.rotation[4] += 0.25f;
  Camera d_camera;
  for (int i = 0; i < 9; ++i) d_camera.rotation[i] = static_cast<float>(i) - 3;
  d_camera.fx = 7;
  CameraParameters expected;
  const CameraParameters d = PullBack(p, d_camera);
  CameraFromParametersAdjointRef(p, d_camera, &expected);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(d.rotation[i], expected.rotation[i], 1e-5);
  EXPECT_EQ(d.fx, 7);
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

}  // namespace tilegrad::camera_parameters_test

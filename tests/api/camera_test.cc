// SPDX-License-Identifier: Apache-2.0
// Cameras of the public interface: made, refused, and as parameters.
#include <gtest/gtest.h>
#include <tilegrad/tilegrad.h>

#include <cmath>
#include <string>

namespace tilegrad::camera_test {

TEST(ApiCamera, ParametersGoThereAndBack) {
  const Result<Camera> camera =
      MakeCamera({.width = 48, .height = 32}, {.azimuth = 30, .elevation = 20, .distance = 2});
  ASSERT_TRUE(camera.ok());
  const Result<Camera> again = CameraFromParameters(ParametersOf(*camera), camera->near_plane);
  ASSERT_TRUE(again.ok());
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(again->rotation[i], camera->rotation[i], 1e-6) << i;
  EXPECT_EQ(again->translation[2], -2);
  EXPECT_EQ(again->cx, 24);
  EXPECT_EQ(again->fx, camera->fx);
  Camera d_camera = {};
  d_camera.fx = 5;
  EXPECT_EQ(PullBack(ParametersOf(*camera), d_camera).fx, 5);
  EXPECT_FALSE(MakeCamera({.fov_y = 180}, {}).ok());
  EXPECT_FALSE(MakeCamera({}, {.distance = 0}).ok());
  EXPECT_FALSE(CameraFromParameters({.rotation = {0, 0, 0, 0, 1, 0}}).ok());
}

// A few roundings of numbers up to 3.
TEST(ApiCamera, OfDoubleHasTheDigitsOfDouble) {
  const Orbit orbit{.azimuth = 30, .elevation = 20, .distance = 3};
  const Result<CameraT<double>> camera = MakeCamera<double>({.width = 48, .height = 32}, orbit);
  ASSERT_TRUE(camera.ok());
  EXPECT_NEAR(camera->rotation[7], std::sin(20 * M_PI / 180), 1e-15);
  EXPECT_NEAR(camera->translation[2], -3, 2e-15);
  const CameraParametersT<double> parameters = ParametersOf(*camera);
  const auto again = CameraFromParameters(parameters, camera->near_plane);
  ASSERT_TRUE(again.ok());
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(again->rotation[i], camera->rotation[i], 1e-15) << i;
  CameraT<double> d_camera = {};
  d_camera.rotation[0] = d_camera.rotation[4] = d_camera.rotation[8] = 0;
  d_camera.rotation[1] = 0.1;  // moves the first row only, and is brought across it
  const CameraParametersT<double> d = PullBack(parameters, d_camera);
  EXPECT_NEAR(d.rotation[1], 0.1 * (1 - camera->rotation[1] * camera->rotation[1]), 1e-16);
  EXPECT_EQ(CameraFromParameters(parameters)->near_plane, 0.01);
}

// From the side of x, with z to the left: the eye is the camera's origin, the target before it.
TEST(ApiCamera, LooksAtTheTarget) {
  const LookAt look_at{.eye = {4, 1, 2}, .target = {1, 1, 2}, .up = {1, 5, 0}};
  const Result<Camera> camera = MakeLookAtCamera({.width = 48, .height = 32}, look_at);
  ASSERT_TRUE(camera.ok()) << camera.status().message();
  const float expected[9] = {0, 0, -1, 0, 1, 0, 1, 0, 0};
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(camera->rotation[i], expected[i], 1e-6) << i;
  EXPECT_NEAR(camera->translation[0], 2, 1e-6);
  EXPECT_NEAR(camera->translation[1], -1, 1e-6);
  EXPECT_NEAR(camera->translation[2], -4, 1e-6);
  EXPECT_EQ(camera->cx, 24);
  const Result<Camera> orbit = MakeCamera({}, {.azimuth = 90, .distance = 3});
  const Result<Camera> same = MakeLookAtCamera({}, {.eye = {0, 0, 3}});
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(same->rotation[i], orbit->rotation[i], 1e-6) << i;
  EXPECT_EQ(same->fx, orbit->fx);
}

TEST(ApiCamera, OutOfRangeIsRefused) {
  const auto message = [](const LookAt& look_at) {
    return MakeLookAtCamera({}, look_at).status().message();
  };
  EXPECT_EQ(message({.target = {0, 0, 1}}),
            "look_at.eye and look_at.target coincide: the viewing direction is undefined");
  EXPECT_EQ(message({.up = {0, NAN, 0}}), "look_at.up is 0 nan 0, must be finite");
  EXPECT_NE(message({.eye = {0, 0, 1e300}}).find("-1e+300: out of range"), std::string::npos);
  EXPECT_TRUE(MakeLookAtCamera<double>({}, {.eye = {0, 0, 1e300}}).ok());
  EXPECT_FALSE(MakeCamera({}, {.distance = 1e300}).ok());
  EXPECT_FALSE(MakeCamera({.fov_y = 1e-300}, {}).ok());
}

}  // namespace tilegrad::camera_test

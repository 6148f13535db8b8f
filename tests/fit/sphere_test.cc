// SPDX-License-Identifier: Apache-2.0
// Where an object is, for cameras of all kinds.
#include "fit/sphere.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "fit/input.h"
#include "fit/run.h"
#include "support/expect.h"

namespace tilegrad::train::sphere_test {

// Inputs of a fit whose truth is a formula: a sphere seen by any cameras.
struct Ball {
  glm::dvec3 centre{0};
  double radius = 0.5;
};

// Whether the ray through a place on the image meets it, in front.
bool Meets(const Ball& ball, const Camera& camera, double x, double y) {
  const float *r = camera.rotation, *t = camera.translation;
  const auto row = [&](int i) { return glm::dvec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]); };
  const glm::dvec3 at(glm::dot(row(0), ball.centre) + static_cast<double>(t[0]),
                      glm::dot(row(1), ball.centre) + static_cast<double>(t[1]),
                      glm::dot(row(2), ball.centre) + static_cast<double>(t[2]));
  const glm::dvec3 along = glm::normalize(
      glm::dvec3((x - static_cast<double>(camera.cx)) / static_cast<double>(camera.fx),
                 -(y - static_cast<double>(camera.cy)) / static_cast<double>(camera.fy), -1));
  return glm::dot(at, along) > 0 && glm::length(glm::cross(at, along)) < ball.radius;
}

// Its masks, grey inside, of images of size x size pixels.
FitInput InputOfBall(const Ball& ball, std::span<const Camera> cameras, int size) {
  FitInput input;
  input.images.width = input.images.height = size;
  for (const Camera& camera : cameras) {
    input.names.push_back("view " + std::to_string(input.names.size()));
    input.training.push_back(static_cast<int>(input.cameras.size()));
    input.cameras.push_back(camera);
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        input.images.alpha.push_back(Meets(ball, camera, x + 0.5, y + 0.5) ? 1.0f : 0.0f);
  }
  input.images.color.assign(3 * input.images.alpha.size(), 0.5f);
  input.masked = true;
  return input;
}

constexpr int kSize = 56;
const Ball kBall{{0.1, -0.05, 0.2}, 0.5};

Camera LookingFrom(glm::dvec3 eye, glm::dvec3 at = kBall.centre, glm::dvec3 up = {0, 1, 0}) {
  const double e[3] = {eye.x, eye.y, eye.z}, t[3] = {at.x, at.y, at.z}, u[3] = {up.x, up.y, up.z};
  return CameraCast<float>(LookAtCamera({50, kSize, kSize}, e, t, u));
}

// On a circle around the ball, 2 away.
std::vector<Camera> Around(int count, double degrees = 360, glm::dvec3 at = kBall.centre) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = degrees * i / count * std::numbers::pi / 180;
    cameras.push_back(
        LookingFrom(at + glm::dvec3(1.9 * std::sin(angle), 0.6, 1.9 * std::cos(angle)), at));
  }
  return cameras;
}

void ExpectBall(const Result<Sphere>& sphere, const Ball& ball = kBall) {
  ASSERT_TRUE(sphere.ok()) << sphere.status().message();
  // Half a pixel of the mask's middle, and of its radius, at that distance.
  const double pixel = 2.0 / (0.5 * kSize / std::tan(25 * std::numbers::pi / 180));
  EXPECT_LT(glm::distance(glm::dvec3(sphere->centre), ball.centre), 4 * pixel);
  EXPECT_NEAR(sphere->radius, ball.radius, 2 * pixel);
  ExpectNotIn(sphere->doubt, "not known");
}

TEST(GuessSphere, IsTheBallThatAllSee) {
  const auto sphere = GuessSphere(InputOfBall(kBall, Around(8), kSize));
  ExpectBall(sphere);
  EXPECT_EQ(sphere->doubt, "");
}

// A rail: one orientation, rounded to floats, so that the axes meet nowhere.
TEST(GuessSphere, FollowsFromParallaxWhereAxesAreParallel) {
  const Camera one = LookingFrom({1.0, 0.7, 1.9});
  std::vector<Camera> cameras;
  for (int i = 0; i < 10; ++i) {
    cameras.push_back(one);
    cameras.back().translation[0] += 0.2f * static_cast<float>(i % 5 - 2);
    cameras.back().translation[1] += 0.3f * static_cast<float>(i / 5);
  }
  ExpectBall(GuessSphere(InputOfBall(kBall, cameras, kSize)));
}

TEST(GuessSphere, SaysThatOneDirectionTellsNoDistance) {
  for (const int count : {1, 5}) {
    const std::vector<Camera> cameras(static_cast<std::size_t>(count), LookingFrom({0, 0.3, 2}));
    const auto sphere = Ok(GuessSphere(InputOfBall(kBall, cameras, kSize)));
    ExpectIn(sphere->doubt, "distance is not known");
    // The world's origin is nearly where the ball is.
    EXPECT_NEAR(sphere->radius, kBall.radius, 0.1);
    EXPECT_LT(glm::distance(glm::dvec3(sphere->centre), kBall.centre), 0.3);
  }
  // Far from the origin the ball has the usual size.
  const Ball far{{40, 0, 0}, 3};
  const auto sphere =
      Ok(GuessSphere(InputOfBall(far, std::vector{LookingFrom({40, 0, 12}, far.centre)}, kSize)));
  EXPECT_NEAR(sphere->radius, 0.5, 0.05);
}

TEST(GuessSphere, LiesBetweenViewsFromOppositeSides) {
  const std::vector<Camera> cameras = {LookingFrom(kBall.centre + glm::dvec3(0, 0, 2)),
                                       LookingFrom(kBall.centre - glm::dvec3(0, 0, 2))};
  const auto sphere = Ok(GuessSphere(InputOfBall(kBall, cameras, kSize)));
  EXPECT_LT(glm::distance(glm::dvec3(sphere->centre), kBall.centre), 0.3);
}

// Off the middle of the picture, with one axis that looks past it.
TEST(GuessSphere, IsWhereMasksAreIfAxesMeetBehindACamera) {
  std::vector<Camera> cameras = Around(6, 60);
  for (Camera& camera : cameras) camera.cx -= 20;  // cropped pictures
  ExpectBall(GuessSphere(InputOfBall(kBall, cameras, kSize)));
}

TEST(GuessSphere, ErrorsNameTheCameraAndTheCause) {
  std::vector<Camera> cameras = Around(6);
  FitInput input = InputOfBall(kBall, cameras, kSize);
  for (Camera& camera : input.cameras) {  // OpenCV's axes, taken for these
    for (int i = 3; i < 9; ++i) camera.rotation[i] *= -1;
    for (int i = 1; i < 3; ++i) camera.translation[i] *= -1;
  }
  ExpectMessage(GuessSphere(input).status(), "view 0", "faces away", "6 of 6", "OpenCV");
  input = InputOfBall(kBall, cameras, kSize);
  input.cameras[3] = LookingFrom({3, 0, 0}, {9, 0, 0});
  input.cameras[4] = LookingFrom({-3, 1, 0}, {-9, 4, 0});
  ExpectMessage(GuessSphere(input).status(), "view ", "faces away", " of 6", "miss each other by");
  input = InputOfBall(kBall, cameras, kSize);
  std::ranges::fill(input.images.alpha, 0.0f);
  ExpectMessage(GuessSphere(input).status(), "all masks are empty");
  // A scene of a thousandth of the size, that is nearer than the near plane.
  input = InputOfBall(kBall, cameras, kSize);
  for (Camera& camera : input.cameras)
    for (float& t : camera.translation) t *= 1e-3f;
  ExpectMessage(GuessSphere(input).status(), "view 0", "near plane of 0.01", "scale");
  // Where steps of floats are larger than pixels.
  const glm::dvec3 utm(1.2e6, 0, 5.1e5);
  input = InputOfBall(kBall, Around(6, 360, utm), kSize);
  std::ranges::fill(input.images.alpha, 1.0f);
  ExpectMessage(GuessSphere(input).status(), "view 0", "move the cameras by (-1.2e+06");
}

TEST(FitCameras, WildNumbersAreRefusedByName) {
  const auto refused = [](const auto& change, const char* part) {
    Camera64 camera = CameraCast<double>(Around(1)[0]);
    change(camera);
    ExpectMessage(CheckCamera(camera, {kSize, kSize}), part);
  };
  for (const double wild : {1e38, 2e37, 1e10, 1e300})
    refused([&](Camera64& c) { c.translation[2] = -wild; }, "from the world's origin");
  for (const double wild : {1e-18, 1e-44, 1e-3, 1e12})
    refused([&](Camera64& c) { c.fx = wild; }, "focal lengths");
  refused([](Camera64& c) { c.cy = -1e20; }, "principal point");
  refused([](Camera64& c) { c.fy = NAN; }, "focal lengths");
  refused([](Camera64& c) { c.rotation[0] = NAN; }, "not finite");
  FitInput input = InputOfBall(kBall, Around(3), kSize);
  input.cameras[1].translation[0] = 1e38f;
  ExpectMessage(FinishInput({}, &input), "view 1", "from the world's origin");
}

// Their hull would be long and thin.
TEST(FitStart, IsASphereWhereAllViewsLookOneWay) {
  FitJob job;
  job.input = InputOfBall(kBall, Around(10, 18), kSize);
  job.config.template_level = 2;
  job.config.texture_size = 32;
  const auto start = Ok(PrepareFit(job, Workers(2)));
  ExpectIn(start->note, "within 1", "depth");
  for (std::size_t i = 0; i < start->scene.positions.size(); i += 3) {
    const float* p = &start->scene.positions[i];
    EXPECT_LT(glm::distance(glm::dvec3(p[0], p[1], p[2]), kBall.centre), 0.7);
  }
  job.input = InputOfBall(kBall, Around(10), kSize);
  EXPECT_EQ(PrepareFit(job, Workers(2)).value().note, "");
}

// A ball of a tenth of the distance, but not one of half of it, which the masks leave long.
TEST(GuessSphere, WhatIsSeenLargeNeedsMoreViewsAround) {
  for (const double radius : {0.1, 0.5}) {
    const Ball ball{kBall.centre, radius};
    const auto sphere = Ok(GuessSphere(InputOfBall(ball, Around(10, 45), kSize)));
    EXPECT_EQ(sphere->doubt.empty(), radius < 0.2) << sphere->doubt;
  }
}

TEST(GuessUp, IsZWhereCamerasStandAboutIt) {
  // Of a ball, in a world with z up and turned to have y up.
  const Ball of_file{{0.1, 0.2, 0.3}, 0.5}, turned{{0.1, 0.3, -0.2}, 0.5};
  std::vector<Camera> of_z, leaning;
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.7 * i;
    const glm::dvec3 eye =
        of_file.centre + glm::dvec3(2 * std::cos(angle), 2 * std::sin(angle), 0.8);
    of_z.push_back(LookingFrom(eye, of_file.centre, {0, 0, 1}));
    leaning.push_back(LookingFrom(eye, of_file.centre, {1, 1, 1}));
  }
  EXPECT_EQ(GuessUp(of_z), UpAxis::kZ);
  EXPECT_EQ(GuessUp(Around(8)), std::nullopt);
  EXPECT_EQ(GuessUp(leaning), std::nullopt);
  EXPECT_EQ(GuessUp(std::span(of_z).first(2)), std::nullopt);
  FitInput input = InputOfBall(of_file, of_z, kSize);
  TurnInputUpright(std::nullopt, &input);
  EXPECT_EQ(input.up, UpAxis::kZ);
  ExpectOnly(input.warnings, "--up y");
  ExpectBall(GuessSphere(input), turned);
  TurnInputUpright(UpAxis::kY, &input);
  EXPECT_EQ(input.warnings.size(), 1u);
}

}  // namespace tilegrad::train::sphere_test

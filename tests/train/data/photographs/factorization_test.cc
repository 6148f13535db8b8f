// SPDX-License-Identifier: Apache-2.0
// Cameras and shapes from keypoints of objects whose shape and cameras are known.
#include "train/data/photographs/factorization.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <numeric>

#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "support/temp_folder.h"

namespace tilegrad::train::factorization_test {

using Point = std::array<double, 3>;

// A box-like animal: pairs left and right, and three points in the plane of symmetry.
const std::vector<Point> kShape = {{0.4, 0.1, 0.6},    {-0.4, 0.1, 0.6}, {0.3, -0.4, -0.5},
                                   {-0.3, -0.4, -0.5}, {0.35, 0.3, 0},   {-0.35, 0.3, 0},
                                   {0, 0.5, 0.3},      {0, -0.2, 0.9},   {0, 0.1, -0.9}};
const std::vector<int> kMirror = {1, 0, 3, 2, 5, 4, 6, 7, 8};
const std::vector<std::pair<int, int>> kLeft = {{1, 0}, {3, 2}, {5, 4}}, kUp = {{2, 6}},
                                       kFront = {{8, 7}};

struct Scene {
  KeypointViews job;
  std::vector<WeakPerspective> cameras;
};

// Views from all around at elevations of up to 40 degrees; a keypoint is hidden where it is far.
Scene MakeScene(int views, double noise, std::uint64_t seed) {
  Rng rng(seed);
  Scene out;
  for (int v = 0; v < views; ++v) {
    const double azimuth = rng.Uniform(0, 2 * std::numbers::pi), tilt = rng.Uniform(-0.2, 0.7);
    // Half a turn about x takes y up to y down; then azimuth about the object's y, tilt about x.
    const std::array<double, 4> spin = {std::cos(azimuth / 2), 0, std::sin(azimuth / 2), 0};
    const double half = (std::numbers::pi + tilt) / 2;
    const double w = std::cos(half), x = std::sin(half);
    const WeakPerspective camera{rng.Uniform(40, 90),
                                 {rng.Uniform(80, 120), rng.Uniform(60, 90)},
                                 {w * spin[0], x * spin[0], w * spin[2], x * spin[2]}};
    std::vector<Keypoint> seen;
    for (const Point& p : kShape) {
      const auto at = ProjectWeakly(camera, p);
      seen.push_back({at[0] + noise * rng.Normal(), at[1] + noise * rng.Normal(), at[2] < 0.3});
    }
    if (std::ranges::count_if(seen, &Keypoint::visible) < 5) continue;
    out.job.views.push_back(seen);
    out.cameras.push_back(camera);
  }
  out.job.mirror = kMirror;
  out.job.left = kLeft;
  out.job.up = kUp;
  return out;
}

double AngleBetween(const WeakPerspective& a, const WeakPerspective& b) {
  const auto qa = weak_ref::UnitQuaternion(a.quaternion),
             qb = weak_ref::UnitQuaternion(b.quaternion);
  const double cosine = std::abs(std::inner_product(qa.begin(), qa.end(), qb.begin(), 0.0));
  return 2 * std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
}

// Turns about x are free (only left, right and up are named), so cameras are compared with the
// first one: R_v R_0^T does not depend on the world.
WeakPerspective Relative(const WeakPerspective& camera, const WeakPerspective& first) {
  const auto a = RotationOf(camera.quaternion), b = RotationOf(first.quaternion);
  Mat3Array product;
  for (int i = 0; i < 9; ++i) {
    product[i] = 0;
    for (int k = 0; k < 3; ++k) product[i] += a[i / 3 * 3 + k] * b[i % 3 * 3 + k];
  }
  return {1, {}, QuaternionOf(product)};
}

double LargestAngle(const Scene& scene, const Structure& found) {
  double largest = 0;
  for (std::size_t v = 0; v < scene.cameras.size(); ++v)
    largest = std::max(largest, AngleBetween(Relative(scene.cameras[v], scene.cameras[0]),
                                             Relative(found.cameras[v], found.cameras[0])));
  return largest;
}

TEST(Factorization, FindsCamerasAndShapeWithHiddenKeypoints) {
  const Scene scene = MakeScene(60, 0, 1);
  const auto found = Ok(FactorizeKeypoints(scene.job));
  EXPECT_LT(found->error, 1e-3);
  EXPECT_LT(LargestAngle(scene, *found), 0.5);
  // Scales in pixels a unit of a shape that is as large as ours times `unit`.
  const double unit = scene.cameras[0].scale / found->cameras[0].scale;
  for (std::size_t v = 0; v < scene.cameras.size(); ++v)
    EXPECT_NEAR(found->cameras[v].scale * unit / scene.cameras[v].scale, 1, 0.01);
  for (std::size_t k = 0; k < kShape.size(); ++k) {
    const Point& p = found->shape[k];
    const Point& m = found->shape[static_cast<std::size_t>(kMirror[k])];
    EXPECT_NEAR(p[0], -m[0], 1e-12);
    EXPECT_NEAR(p[1], m[1], 1e-12);
    EXPECT_NEAR(p[0], kShape[k][0] * unit, 0.01) << k;  // left is +x
  }
  EXPECT_GT(found->shape[6][1], found->shape[2][1]);  // up is +y
  EXPECT_GT(found->shape[7][2], found->shape[8][2]);  // so the front is +z: right-handed
}

TEST(Factorization, StandsNoise) {
  const Scene scene = MakeScene(120, 2.0, 2);  // of about 100 pixels
  const auto found = Ok(FactorizeKeypoints(scene.job));
  EXPECT_LT(found->error, 0.05);
  double sum = 0;
  for (std::size_t v = 0; v < scene.cameras.size(); ++v)
    sum += AngleBetween(Relative(scene.cameras[v], scene.cameras[0]),
                        Relative(found->cameras[v], found->cameras[0]));
  EXPECT_LT(sum / static_cast<double>(scene.cameras.size()), 10);
}

// With left, up and front the handedness is known, whatever is hidden.
TEST(Factorization, NamesDecideWhichOfTheTwoShapesItIs) {
  Scene scene = MakeScene(60, 0, 3);
  for (auto& view : scene.job.views)
    for (Keypoint& k : view) k.visible = true;
  scene.job.front = kFront;
  const auto found = Ok(FactorizeKeypoints(scene.job));
  EXPECT_LT(LargestAngle(scene, *found), 0.01);
  EXPECT_GT(found->shape[7][2], found->shape[8][2]);
}

TEST(Factorization, TheSameBitsEveryTime) {
  const Scene scene = MakeScene(20, 1, 4);
  const auto a = FactorizeKeypoints(scene.job), b = FactorizeKeypoints(scene.job);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->shape, b->shape);
}

TEST(Factorization, TooLittleIsAnError) {
  Scene scene = MakeScene(20, 0, 5);
  KeypointViews few = scene.job;
  few.views.resize(3);
  ExpectMessage(FactorizeKeypoints(few).status(), "at least 8", "there are 3");
  few = scene.job;
  for (Keypoint& k : few.views[2]) k.visible = false;
  ExpectMessage(FactorizeKeypoints(few).status(), "photograph 2", "there are 0");
  few = scene.job;
  few.left.clear();
  ExpectMessage(FactorizeKeypoints(few).status(), "left and right");
}

TEST(WeakCameraFit, FindsTheCamera) {
  const Scene scene = MakeScene(30, 0, 6);
  for (std::size_t v = 0; v < scene.cameras.size(); ++v) {
    WeakPerspective start = scene.cameras[v];
    start.scale *= 1.3;
    start.translation[0] += 9;
    start.quaternion[2] += 0.2;
    start.quaternion[0] -= 0.1;
    const auto found = FitWeakCamera(kShape, scene.job.views[v], start);
    EXPECT_LT(WeakCameraError(kShape, scene.job.views[v], found), 1e-5);
    EXPECT_LT(AngleBetween(found, scene.cameras[v]), 1e-3);
  }
}

}  // namespace tilegrad::train::factorization_test

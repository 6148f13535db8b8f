// SPDX-License-Identifier: Apache-2.0
// Faces cut at the near plane: which of coinciding ones is seen, and how many digits images and
// gradients keep (docs/numerics.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "api/test_scene.h"

namespace tilegrad::cut_faces_test {

// A wall that reaches past the camera: what the image shows of it lies far from where it is cut, at
// a hundredth of that depth. T: float or double.
template <class T>
struct CutWall {
  std::vector<T> positions, attributes = {T(1), T(0.25), T(-0.5)};
  std::vector<std::int32_t> faces = {0, 1, 2};
  SceneT<T> scene;

  explicit CutWall(test::Numbers* numbers, double size = 4)
      : positions(numbers->Vector<T>(9, size)) {
    for (T& p : positions) p = static_cast<T>(static_cast<float>(p));
    scene.positions = positions;
    scene.faces = faces;
    scene.attributes = {attributes, Rate::kVertex};
    scene.channels = 1;
    scene.camera.fx = scene.camera.fy = 20;
    scene.camera.cx = 24;
    scene.camera.cy = 20;
    scene.camera.near_plane = static_cast<T>(0.01f);
  }
};

constexpr RenderOptions kWallOptions{.width = 48, .height = 40};

// The same walls in float and in double, one after the other.
struct WallsInBoth {
  test::Numbers numbers, again;
  std::optional<CutWall<float>> wall;
  std::optional<CutWall<double>> same;
  Renderer renderer;
  RendererT<double> reference;
  Frame frame;
  FrameT<double> truth;

  void RenderNext(const RenderOptions& options, const Outputs& outputs) {
    wall.emplace(&numbers);
    same.emplace(&again);
    ASSERT_TRUE(renderer.Render({&wall->scene, 1}, options, outputs, &frame).ok());
    ASSERT_TRUE(reference.Render({&same->scene, 1}, options, outputs, &truth).ok());
  }
  // Of a pixel: the wall is there in both.
  bool IsSeen(std::size_t pixel) const {
    return frame.images().face_ids[pixel] >= 0 && truth.images().face_ids[pixel] >= 0;
  }
  std::size_t pixels() const { return frame.images().face_ids.size(); }
};

// The largest size of a number.
double MostOf(const std::vector<double>& numbers) {
  double most = 0;
  for (const double d : numbers) most = std::max(most, std::abs(d));
  return most;
}

// Wherever faces start and however they are wound, all of them cut at the near plane.
template <class T>
void ExpectTheLowerIdOfCoincidingWalls() {
  test::Numbers numbers;
  RendererT<T> renderer;
  FrameT<T> frame;
  int pixels = 0;
  for (int trial = 0; trial < 200; ++trial) {
    CutWall<T> wall(&numbers);
    wall.faces = {0, 1, 2, 1, 2, 0, 0, 2, 1, 2, 1, 0};
    std::rotate(wall.faces.begin(), wall.faces.begin() + 3 * (trial % 4), wall.faces.end());
    wall.scene.faces = wall.faces;
    ASSERT_TRUE(renderer.Render({&wall.scene, 1}, kWallOptions, {}, &frame).ok());
    for (const std::int32_t id : frame.images().face_ids) {
      ASSERT_LE(id, 0) << trial;
      pixels += id == 0;
    }
  }
  EXPECT_GT(pixels, 1000);
}

TEST(CutFaces, CoincidingOnesShowTheLowerId) {
  ExpectTheLowerIdOfCoincidingWalls<float>();
  ExpectTheLowerIdOfCoincidingWalls<double>();
}

// Depth and attribute of a wall at a pixel centre, from the plane through its corners.
struct OnPlane {
  long double depth, attribute;

  template <class T>
  OnPlane(const CutWall<T>& wall, std::size_t column, std::size_t row) {
    using Point = std::array<long double, 3>;
    const auto dot = [](const Point& a, const Point& b) {
      return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    };
    const auto cross = [](const Point& a, const Point& b) -> Point {
      return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    };
    const auto corner = [&](std::size_t k) -> Point {
      return {wall.positions[3 * k], wall.positions[3 * k + 1], wall.positions[3 * k + 2]};
    };
    const auto minus = [](const Point& a, const Point& b) -> Point {
      return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    };
    const CameraT<T>& camera = wall.scene.camera;
    const Point ray = {(static_cast<long double>(column) + 0.5L - camera.cx) / camera.fx,
                       (camera.cy - static_cast<long double>(row) - 0.5L) / camera.fy, -1};
    const Point start = corner(0), e1 = minus(corner(1), start), e2 = minus(corner(2), start);
    const Point normal = cross(e1, e2);
    depth = dot(start, normal) / dot(ray, normal);
    const Point hit = minus({depth * ray[0], depth * ray[1], depth * ray[2]}, start);
    const long double b1 = dot(cross(hit, e2), normal) / dot(normal, normal);
    const long double b2 = dot(cross(e1, hit), normal) / dot(normal, normal);
    const auto& a = wall.attributes;
    attribute = a[0] + b1 * (a[1] - a[0]) + b2 * (a[2] - a[0]);
  }
};

// In units in which the wall is `size` large. Faces begin anew in each.
template <class T>
void ExpectDepthAndAttributesOnThePlane(double size, double tolerance) {
  SCOPED_TRACE(size);
  test::Numbers numbers;
  RendererT<T> renderer;
  FrameT<T> frame;
  int pixels = 0;
  for (int trial = 0; trial < 200; ++trial) {
    CutWall<T> wall(&numbers, size);
    const Outputs outputs{.color = false, .depth = true};
    ASSERT_TRUE(renderer.Render({&wall.scene, 1}, kWallOptions, outputs, &frame).ok());
    const ImagesT<T>& images = frame.images();
    for (std::size_t i = 0; i < images.face_ids.size(); ++i) {
      if (images.face_ids[i] < 0) continue;
      ++pixels;
      const OnPlane truth(wall, i % kWallOptions.width, i / kWallOptions.width);
      EXPECT_NEAR(images.depth[i] / truth.depth, 1, tolerance) << trial << ' ' << i;
      EXPECT_NEAR(images.attributes[i], truth.attribute, 2 * tolerance) << trial << ' ' << i;
    }
  }
  EXPECT_GT(pixels, 40000);
}

// Corners are rounded where the wall is cut, up to 1e9 pixels away in the largest units; seen from
// the far corner they turn the plane by some roundings, whatever the unit. Of 170 roundings in
// float, 100 in double; planes that start at a near corner lose (size / near)^2 of the digits of
// walls seen nearly edge-on.
TEST(CutFaces, DepthAndAttributesKeepTheirDigitsInAnyUnit) {
  for (const double size : {4.0, 4e3, 4e5}) {
    ExpectDepthAndAttributesOnThePlane<float>(size, 2e-5);
    ExpectDepthAndAttributesOnThePlane<double>(size, 5e-14);
  }
}

// Weights are 1 at most, and amplify what is rounded of a face's 1/depth, which varies by up to 500
// in these.
TEST(CutFaces, WeightsKeepTheirDigits) {
  WallsInBoth walls;
  for (int trial = 0; trial < 200; ++trial) {
    walls.RenderNext(kWallOptions, {.color = false, .barycentrics = true});
    for (std::size_t i = 0; i < walls.pixels(); ++i) {
      if (!walls.IsSeen(i)) continue;
      for (const std::size_t k : {i, i + walls.pixels()}) {
        EXPECT_NEAR(walls.frame.images().barycentrics[k], walls.truth.images().barycentrics[k],
                    5e-5)
            << trial << ' ' << i;
      }
    }
  }
}

template <class T>
std::vector<double> PullAtPositions(RendererT<T>* renderer, const FrameT<T>& frame,
                                    const FrameGradientsT<T>& d_frame) {
  std::vector<T> d_positions(9);
  SceneGradientsT<T> d_scene;
  d_scene.positions = d_positions;
  EXPECT_TRUE(renderer->Backward(frame, d_frame, {&d_scene, 1}).ok());
  return {d_positions.begin(), d_positions.end()};
}

// Alpha of a wall, and how all of its images pull at its positions.
template <class T>
std::pair<std::vector<double>, std::vector<double>> AlphaAndPull(RendererT<T>* renderer,
                                                                 const CutWall<T>& wall) {
  RenderOptions options = kWallOptions;
  options.delta = 1e-3;
  options.max_alpha_error = 0;
  FrameT<T> frame;
  EXPECT_TRUE(renderer->Render({&wall.scene, 1}, options, {}, &frame).ok());
  const ImagesT<T>& images = frame.images();
  test::Numbers numbers;
  const auto d_alpha = numbers.Vector<T>(images.alpha.size());
  const auto d_attributes = numbers.Vector<T>(images.attributes.size());
  FrameGradientsT<T> d_frame;
  d_frame.alpha = d_alpha;
  d_frame.attributes = d_attributes;
  return {{images.alpha.begin(), images.alpha.end()}, PullAtPositions(renderer, frame, d_frame)};
}

// Alpha counts the pieces of a cut face, so these must not depend on where it starts or how it is
// wound; then neither do gradients, but for the order of their roundings. The corners are the same
// bits. What double rounds is at some 1e4 pixels, 1e-12; float sets up edges in double, and ends
// with some ten roundings of 1. Of pixels that pull against each other a hundredth may be left.
template <class T>
void ExpectCutFacesToBeTheSameFromAnyCorner(double alpha_tolerance, double pull_tolerance) {
  test::Numbers numbers;
  RendererT<T> renderer;
  int walls = 0;
  for (int trial = 0; trial < 200; ++trial) {
    CutWall<T> wall(&numbers);
    const auto [alpha, pull] = AlphaAndPull(&renderer, wall);
    const double most = MostOf(pull);
    walls += most > 1e-3;
    for (const auto& order : {std::vector{1, 2, 0}, std::vector{0, 2, 1}, std::vector{2, 1, 0}}) {
      wall.faces.assign(order.begin(), order.end());
      wall.scene.faces = wall.faces;
      const auto [other_alpha, other_pull] = AlphaAndPull(&renderer, wall);
      for (std::size_t i = 0; i < alpha.size(); ++i) {
        ASSERT_NEAR(other_alpha[i], alpha[i], alpha_tolerance) << trial << ' ' << i;
      }
      for (std::size_t i = 0; i < pull.size() && most > 1e-3; ++i) {
        ASSERT_NEAR(other_pull[i], pull[i], pull_tolerance * most) << trial << ' ' << i;
      }
    }
  }
  EXPECT_GT(walls, 80);
}

TEST(CutFaces, AreTheSameFromAnyCorner) {
  ExpectCutFacesToBeTheSameFromAnyCorner<float>(1e-5, 1e-3);
  ExpectCutFacesToBeTheSameFromAnyCorner<double>(1e-11, 1e-9);
}

// dL/d(positions) of a wall in its attributes, from cotangents that are 0 where `seen` is not
// set.
template <class T>
std::vector<double> AttributesPull(RendererT<T>* renderer, const FrameT<T>& frame,
                                   const std::vector<bool>& seen) {
  test::Numbers numbers;
  std::vector<T> d_attributes(seen.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto d = static_cast<T>(static_cast<float>(numbers.Next()));
    if (seen[i]) d_attributes[i] = d;
  }
  FrameGradientsT<T> d_frame;
  d_frame.attributes = d_attributes;
  return PullAtPositions(renderer, frame, d_frame);
}

// Corners are rounded at some 1e4 pixels, by 5e-4 pixels of images 40 high: 1e-5; of pixels that
// pull against each other a hundredth may be left. The most of 1,700 such walls was 4e-4 in
// perspective and 8e-4 linear on the screen, where with weights in float one of twenty was off by
// more than 1e-3.
TEST(CutFaces, GradientsKeepTheirDigits) {
  for (const auto mode : {Interpolation::kPerspective, Interpolation::kScreenLinear}) {
    RenderOptions options = kWallOptions;
    options.interpolation = mode;
    WallsInBoth walls;
    int pulled = 0;
    for (int trial = 0; trial < 300; ++trial) {
      walls.RenderNext(options, {});
      std::vector<bool> seen(walls.pixels());
      for (std::size_t i = 0; i < seen.size(); ++i) seen[i] = walls.IsSeen(i);
      const auto got = AttributesPull(&walls.renderer, walls.frame, seen);
      const auto expected = AttributesPull(&walls.reference, walls.truth, seen);
      const double most = MostOf(expected);
      pulled += most > 0;
      for (std::size_t i = 0; i < got.size(); ++i) {
        EXPECT_NEAR(got[i], expected[i], 1e-3 * most) << trial << ' ' << i;
      }
    }
    EXPECT_GT(pulled, 100);
  }
}

}  // namespace tilegrad::cut_faces_test

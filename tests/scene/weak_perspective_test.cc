// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <complex>
#include <functional>
#include <numbers>
#include <numeric>

#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "support/expect.h"

namespace tilegrad::weak_perspective_test {

using Complex = std::complex<double>;
constexpr double kHalf = std::numbers::sqrt2 / 2;

WeakPerspective RandomCamera(Rng& rng) {
  WeakPerspective camera{rng.Uniform(0.5, 30), {rng.Uniform(-5, 5), rng.Uniform(-5, 5)}, {}};
  for (double& c : camera.quaternion) c = rng.Normal();
  return camera;
}

std::array<double, 3> RandomPoint(Rng& rng) { return {rng.Normal(), rng.Normal(), rng.Normal()}; }

WeakPerspectiveT<Complex> ToComplex(const WeakPerspective& c) {
  WeakPerspectiveT<Complex> out;
  out.scale = c.scale;
  for (int i = 0; i < 2; ++i) out.translation[i] = c.translation[i];
  for (int i = 0; i < 4; ++i) out.quaternion[i] = c.quaternion[i];
  return out;
}

// The seven numbers of a camera, in one order.
template <class T>
T& NumberOf(WeakPerspectiveT<T>& camera, int i) {
  return i == 0 ? camera.scale : i < 3 ? camera.translation[i - 1] : camera.quaternion[i - 3];
}

// By hand: a quarter turn about z takes x to y (downwards in the image), and y to -x.
TEST(WeakPerspective, ProjectsAsTheFormulaSays) {
  const WeakPerspective camera{10, {100, 50}, {kHalf, 0, 0, kHalf}};
  const auto p = ProjectWeakly(camera, {1, 2, 3});
  EXPECT_NEAR(p[0], 100 - 10 * 2, 1e-12);
  EXPECT_NEAR(p[1], 50 + 10 * 1, 1e-12);
  EXPECT_NEAR(p[2], 3, 1e-12);
  // The quaternion's length does not matter, nor does its sign.
  const WeakPerspective longer{10, {100, 50}, {-3 * kHalf, 0, 0, -3 * kHalf}};
  EXPECT_NEAR(ProjectWeakly(longer, {1, 2, 3})[0], 80, 1e-12);
}

// By hand: turns by 90 degrees about each axis.
TEST(WeakPerspective, RotationsOfQuaternions) {
  const std::array<double, 9> about_x = RotationOf<double>({kHalf, kHalf, 0, 0});
  const std::array<double, 9> about_y = RotationOf<double>({kHalf, 0, kHalf, 0});
  const double x[9] = {1, 0, 0, 0, 0, -1, 0, 1, 0}, y[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
  for (int i = 0; i < 9; ++i) {
    EXPECT_NEAR(about_x[i], x[i], 1e-15);
    EXPECT_NEAR(about_y[i], y[i], 1e-15);
  }
}

TEST(WeakPerspective, QuaternionsComeBackFromRotations) {
  Rng rng(1);
  for (int i = 0; i < 1000; ++i) {
    WeakPerspective camera = RandomCamera(rng);
    // Half turns, where w is 0, and turns about axes.
    if (i % 4 == 0) camera.quaternion[0] = 0;
    if (i % 8 == 0) camera.quaternion[1] = 0;
    const auto unit = weak_ref::UnitQuaternion(camera.quaternion);
    const auto back = QuaternionOf(RotationOf(camera.quaternion));
    EXPECT_NEAR(std::abs(std::inner_product(unit.begin(), unit.end(), back.begin(), 0.0)), 1,
                1e-14);
    EXPECT_GE(back[0], 0);
  }
}

// Complex step is exact up to rounding, so the adjoint has to agree to 1e-12 of its size.
TEST(WeakPerspective, AdjointsOfProjections) {
  Rng rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const WeakPerspective camera = RandomCamera(rng);
    const auto point = RandomPoint(rng);
    const std::array<double, 2> d = {rng.Normal(), rng.Normal()};
    WeakPerspective d_camera{0, {}, {}};
    d_camera.quaternion = {};
    std::array<double, 3> d_point{};
    ProjectWeaklyAdjoint(camera, point, d, &d_camera, &d_point);
    const auto derivative =
        [&](const std::function<void(WeakPerspectiveT<Complex>&, std::array<Complex, 3>&)>& move) {
          auto c = ToComplex(camera);
          std::array<Complex, 3> p = {point[0], point[1], point[2]};
          move(c, p);
          const auto image = ProjectWeakly(c, p);
          return (d[0] * image[0].imag() + d[1] * image[1].imag()) / 1e-30;
        };
    for (int i = 0; i < 7; ++i) {
      const double want = derivative([&](auto& c, auto&) { NumberOf(c, i) += Complex(0, 1e-30); });
      EXPECT_NEAR(NumberOf(d_camera, i), want, 1e-12 * (1 + std::abs(want))) << i;
    }
    for (int i = 0; i < 3; ++i) {
      const double want = derivative([&](auto&, auto& p) { p[i] += Complex(0, 1e-30); });
      EXPECT_NEAR(d_point[i], want, 1e-12 * (1 + std::abs(want))) << i;
    }
  }
}

template <class T>
T Weighed(const CameraT<T>& c, const std::array<double, 16>& w) {
  T sum = w[12] * c.fx + w[13] * c.fy + w[14] * c.cx + w[15] * c.cy;
  for (int i = 0; i < 9; ++i) sum += w[i] * c.rotation[i];
  for (int i = 0; i < 3; ++i) sum += w[9 + i] * c.translation[i];
  return sum;
}

TEST(WeakPerspective, AdjointOfThePinhole) {
  Rng rng(3);
  for (int trial = 0; trial < 100; ++trial) {
    const WeakPerspective camera = RandomCamera(rng);
    std::array<double, 16> w;
    for (double& x : w) x = rng.Normal();
    CameraT<double> d_pinhole;
    std::copy_n(w.begin(), 9, d_pinhole.rotation);
    std::copy_n(&w[9], 3, d_pinhole.translation);
    d_pinhole.fx = w[12];
    d_pinhole.fy = w[13];
    d_pinhole.cx = w[14];
    d_pinhole.cy = w[15];
    WeakPerspective d_camera;
    PinholeOfAdjoint(camera, 7.0, d_pinhole, &d_camera);
    for (int i = 0; i < 7; ++i) {
      auto c = ToComplex(camera);
      NumberOf(c, i) += Complex(0, 1e-30);
      const double want = Weighed(PinholeOf(c, Complex(7.0)), w).imag() / 1e-30;
      EXPECT_NEAR(NumberOf(d_camera, i), want, 1e-12 * (1 + std::abs(want))) << i;
    }
  }
}

std::array<double, 2> SeenBy(const Camera64& c, const std::array<double, 3>& p) {
  double q[3];
  for (int r = 0; r < 3; ++r)
    q[r] = c.rotation[3 * r] * p[0] + c.rotation[3 * r + 1] * p[1] + c.rotation[3 * r + 2] * p[2] +
           c.translation[r];
  return {c.cx + c.fx * q[0] / -q[2], c.cy - c.fy * q[1] / -q[2]};
}

// x - translation = (x' - translation) / (1 + z / distance), exactly.
TEST(WeakPerspective, PinholesSeeTheSameButForDepth) {
  Rng rng(4);
  for (int trial = 0; trial < 100; ++trial) {
    const WeakPerspective camera = RandomCamera(rng);
    const auto point = RandomPoint(rng);
    const double distance = rng.Uniform(10, 2000);
    const Camera64 pinhole = PinholeOf(camera, distance);
    EXPECT_TRUE(Validate(pinhole).ok());
    const auto weak = ProjectWeakly(camera, point);
    const auto seen = SeenBy(pinhole, point);
    for (int i = 0; i < 2; ++i) {
      const double t = camera.translation[i];
      EXPECT_NEAR(seen[i] - t, (weak[i] - t) / (1 + weak[2] / distance), 1e-9);
    }
    const auto back = Ok(WeakPerspectiveOf(pinhole, {0, 0, 0}));
    EXPECT_NEAR(back->scale, camera.scale, 1e-9);
    const auto again = ProjectWeakly(*back, point);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(again[i], weak[i], 1e-8);
  }
}

// At the centre itself the conversion is exact for any camera.
TEST(WeakPerspective, OfAPinholeAroundAPoint) {
  Camera64 camera = PinholeOf(WeakPerspective{20, {30, 40}, {0.9, 0.1, -0.3, 0.2}}, 5.0);
  const Vec3Array centre = {0.4, -0.2, 0.7};
  const auto weak = Ok(WeakPerspectiveOf(camera, centre));
  const auto seen = SeenBy(camera, centre);
  const auto want = ProjectWeakly(*weak, centre);
  EXPECT_NEAR(seen[0], want[0], 1e-10);
  EXPECT_NEAR(seen[1], want[1], 1e-10);
  EXPECT_FALSE(WeakPerspectiveOf(camera, {0, 0, 1000}).ok() &&
               WeakPerspectiveOf(camera, {0, 0, -1000}).ok());
  camera.fx *= 1.1;
  EXPECT_FALSE(WeakPerspectiveOf(camera, centre).ok());
}

TEST(WeakPerspective, MirrorsAndCrops) {
  Rng rng(5);
  for (int trial = 0; trial < 100; ++trial) {
    const WeakPerspective camera = RandomCamera(rng);
    const auto p = RandomPoint(rng);
    const auto seen = ProjectWeakly(camera, p);
    const auto mirrored = ProjectWeakly(MirroredCamera(camera, 64), {-p[0], p[1], p[2]});
    EXPECT_NEAR(mirrored[0], 64 - seen[0], 1e-10);
    EXPECT_NEAR(mirrored[1], seen[1], 1e-10);
    EXPECT_NEAR(mirrored[2], seen[2], 1e-10);
    const auto cropped = ProjectWeakly(CroppedCamera(camera, 3, -4, 0.5), p);
    EXPECT_NEAR(cropped[0], (seen[0] - 3) * 0.5, 1e-10);
    EXPECT_NEAR(cropped[1], (seen[1] + 4) * 0.5, 1e-10);
  }
}

}  // namespace tilegrad::weak_perspective_test

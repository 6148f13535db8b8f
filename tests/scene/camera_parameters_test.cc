// SPDX-License-Identifier: Apache-2.0
// The adjoint of a camera's parameters against a complex step through them and the projection of a
// point. Tolerance: a complex step has no truncation error; both sides are some 100 roundings of
// terms up to the largest entry of the gradient's own terms: 1e-12 of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/rng.h"
#include "raster/project_ref.h"
#include "scene/camera.h"
#include "scene/camera_ref.h"
#include "scene/lens_distortion.h"
#include "scene/mesh.h"
#include "scene/shapes.h"
#include "scene/weak_perspective_ref.h"
#include "support/expect.h"

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
    const auto entries = Entries<Complex>(step);
    const auto numbers = Entries<double>(p);
    for (std::size_t i = 0; i < numbers.size(); ++i) entries[i].get() = numbers[i];
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

namespace tilegrad::framing_test {

// Every vertex is inside of every picture and beyond the near plane, and some vertex touches the
// margin: the camera is as near as it may be. Tolerance: pixels of up to 320 in float.
TEST(Framing, SeesTheWholeMeshAndNoMore) {
  const Mesh mesh = Box({5, -3, 70}, {4, 0.5f, 9});
  const Framing framing{{35, 320, 200}, 0.1};
  std::vector<ViewAngle> views;
  for (int i = 0; i < 24; ++i) views.push_back({15.0 * i, 7.0 * i - 80});
  const auto cameras = Ok(FrameMesh(mesh, framing, views));
  double reached = 0;
  for (const Camera& c : *cameras) {
    for (const glm::vec3& p : mesh.positions) {
      double at[3];
      for (int r = 0; r < 3; ++r) {
        at[r] = c.translation[r];
        for (int k = 0; k < 3; ++k) at[r] += c.rotation[3 * r + k] * p[k];
      }
      ASSERT_GT(-at[2], c.near_plane);
      const double x = c.fx * at[0] / -at[2] / 160, y = c.fy * at[1] / -at[2] / 100;
      reached = std::max({reached, std::abs(x), std::abs(y)});
    }
  }
  EXPECT_NEAR(reached, 0.9, 1e-4);
}

TEST(Framing, WhatCannotBeSeenIsRefused) {
  const std::vector<ViewAngle> one(1);
  const Lens lens{35, 64, 64};
  Mesh point = Box({1, 1, 1}, {0, 0, 0});
  ExpectMessage(FrameMesh(point, {lens}, one).status(), "extent");
  const Mesh box = Box({0, 0, 0}, {1, 1, 1});
  ExpectMessage(FrameMesh(box, {{180, 64, 64}}, one).status(), "field of view");
  ExpectMessage(FrameMesh(box, {{35, 0, 64}}, one).status(), "0 x 64");
  ExpectMessage(FrameMesh(box, {lens, 1}, one).status(), "margin");
  ExpectMessage(FrameMesh(box, {lens, 0, -1}, one).status(), "distance");
}

TEST(UpAxis, Names) {
  EXPECT_EQ(UpAxisNamed("y"), UpAxis::kY);
  EXPECT_EQ(UpAxisNamed("Z"), UpAxis::kZ);
  EXPECT_EQ(UpAxisNamed("x"), UpAxis::kX);
  for (const char* name : {"", "w", "zz", "-z", "0"}) EXPECT_FALSE(UpAxisNamed(name)) << name;
}

// Up becomes +y; of a mesh with z up, what faces -y faces +z.
TEST(UpAxis, TurnsMeshes) {
  Mesh mesh;
  mesh.positions = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  mesh.normals = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  mesh.corner_normals = {{1, 2, 3}};
  Mesh z = mesh, x = mesh, y = mesh;
  TurnUpright(UpAxis::kZ, &z);
  EXPECT_EQ(z.positions, (std::vector<glm::vec3>{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}));
  EXPECT_EQ(z.normals, z.positions);
  EXPECT_EQ(z.corner_normals[0], glm::vec3(1, 3, -2));
  TurnUpright(UpAxis::kX, &x);
  EXPECT_EQ(x.positions, (std::vector<glm::vec3>{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}));
  EXPECT_EQ(x.corner_normals[0], glm::vec3(-2, 1, 3));
  TurnUpright(UpAxis::kY, &y);
  EXPECT_EQ(y.positions, mesh.positions);
}

// Camera coordinates are the same, and turning is a rotation, not a mirror.
TEST(UpAxis, CamerasOfTheFileSeeTheSame) {
  for (const UpAxis up : {UpAxis::kY, UpAxis::kZ, UpAxis::kX}) {
    const Camera camera = OrbitCamera({}, 30, 20, 3), of_file = CameraOfFile(up, camera);
    Mesh mesh;
    mesh.positions = {{0.3f, -0.7f, 0.2f}};
    const glm::vec3 p = mesh.positions[0];
    TurnUpright(up, &mesh);
    const glm::vec3 q = mesh.positions[0];
    for (int i = 0; i < 3; ++i) {
      const float *a = of_file.rotation + 3 * i, *b = camera.rotation + 3 * i;
      EXPECT_NEAR(a[0] * p.x + a[1] * p.y + a[2] * p.z, b[0] * q.x + b[1] * q.y + b[2] * q.z, 1e-6);
      EXPECT_EQ(of_file.translation[i], camera.translation[i]);
    }
  }
}

}  // namespace tilegrad::framing_test

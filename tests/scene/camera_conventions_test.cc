// SPDX-License-Identifier: Apache-2.0
// Each converter against the projection given in its convention's manual, and as a round
// trip.
//
// Tolerance: all is double. A pixel is made of some 30 roundings of numbers up to kLargest pixels
// (the images are below 2,000 pixels and points within them or up to 10 times beside), divided by
// depths of at least 0.5: 30 * 2^-53 * 2e4 / 0.5 < 2e-10.
#include "scene/camera_conventions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "base/rng.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"

namespace tilegrad::camera_conventions_test {

constexpr double kPixelTolerance = 2e-10;
constexpr double kNumberTolerance = 1e-11;  // entries up to 2,000 after some 10 roundings

struct Pixel {
  double x, y;
};

Vec3Array Affine(const double* rotation, const double* translation, const Vec3Array& p) {
  Vec3Array out;
  for (int r = 0; r < 3; ++r) {
    out[r] = translation[r];
    for (int c = 0; c < 3; ++c) out[r] += rotation[3 * r + c] * p[c];
  }
  return out;
}

Pixel Project(const Camera64& camera, const Vec3Array& world) {
  const Vec3Array p = Affine(camera.rotation, camera.translation, world);
  return {camera.cx - camera.fx * p[0] / p[2], camera.cy + camera.fy * p[1] / p[2]};
}

// Any pose and any image; the principal point in the middle only where asked.
struct Case {
  Camera64 camera;
  ImageSize size;
  std::vector<Vec3Array> points;  // before the camera
};

Case RandomCase(Rng& rng, bool centred) {
  Case out;
  out.size = {static_cast<int>(rng.Uniform(1, 1900)), static_cast<int>(rng.Uniform(1, 1900))};
  Camera64& c = out.camera;
  const Mat3Array r =
      RotationFromVector({rng.Uniform(-3, 3), rng.Uniform(-3, 3), rng.Uniform(-3, 3)});
  std::copy(r.begin(), r.end(), c.rotation);
  for (double& t : c.translation) t = rng.Uniform(-2, 2);
  c.fx = rng.Uniform(20, 2000);
  c.fy = rng.Uniform(20, 2000);
  c.cx = 0.5 * out.size.width;
  c.cy = 0.5 * out.size.height;
  if (!centred) {
    c.cx += rng.Uniform(-300, 300);
    c.cy += rng.Uniform(-300, 300);
  }
  for (int i = 0; i < 8; ++i) {
    const Vec3Array at = {rng.Uniform(-2, 2), rng.Uniform(-2, 2), rng.Uniform(-6, -0.5)};
    Vec3Array world = {};  // R^T (at - t)
    for (int k = 0; k < 9; ++k) world[k % 3] += r[k] * (at[k / 3] - c.translation[k / 3]);
    out.points.push_back(world);
  }
  return out;
}

void ExpectSame(const Camera64& a, const Camera64& b) {
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(a.rotation[i], b.rotation[i], kNumberTolerance);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.translation[i], b.translation[i], kNumberTolerance);
  EXPECT_NEAR(a.fx, b.fx, kNumberTolerance * 2000);
  EXPECT_NEAR(a.fy, b.fy, 2000 * kNumberTolerance);
  EXPECT_NEAR(a.cx, b.cx, kNumberTolerance);
  EXPECT_NEAR(a.cy, b.cy, kNumberTolerance);
}

// to: camera -> Result of the other; manual(other, size, world point) -> pixel of ours.
template <class To, class From, class Manual>
void ExpectAgrees(bool centred, const To& to, const From& from, const Manual& manual) {
  Rng rng(7);
  for (int trial = 0; trial < 50; ++trial) {
    const Case c = RandomCase(rng, centred);
    const auto other = Ok(to(c.camera, c.size));
    const auto back = Ok(from(*other, c.size));
    ExpectSame(*back, c.camera);
    for (const Vec3Array& point : c.points) {
      const Pixel ours = Project(c.camera, point), theirs = manual(*other, c.size, point);
      const double scale = std::max({1.0, std::abs(ours.x) / 2e4, std::abs(ours.y) / 2e4});
      EXPECT_NEAR(ours.x, theirs.x, kPixelTolerance * scale);
      EXPECT_NEAR(ours.y, theirs.y, kPixelTolerance * scale);
    }
  }
}

Pixel FromNdc(double x, double y, ImageSize s) {
  return {0.5 * s.width * (x + 1), 0.5 * s.height * (1 - y)};
}

TEST(CameraConventions, OpenCv) {
  for (const PixelCentre centre : {PixelCentre::kInteger, PixelCentre::kHalf}) {
    const double shift = centre == PixelCentre::kInteger ? 0.5 : 0;
    ExpectAgrees(
        false,
        [&](const Camera64& c, ImageSize) { return Result<OpenCvCamera>(ToOpenCv(c, centre)); },
        [](const OpenCvCamera& c, ImageSize) { return FromOpenCv(c); },
        [&](const OpenCvCamera& c, ImageSize, const Vec3Array& world) {
          const Vec3Array p = Affine(c.rotation.data(), c.translation.data(), world);
          return Pixel{c.k[0] * p[0] / p[2] + c.k[2] + shift,
                       c.k[4] * p[1] / p[2] + c.k[5] + shift};
        });
  }
}

// COLMAP's documentation: R of the quaternion (Hamilton), t, then its PINHOLE.
TEST(CameraConventions, Colmap) {
  ExpectAgrees(
      false, [](const Camera64& c, ImageSize) { return Result<ColmapCamera>(ToColmap(c)); },
      [](const ColmapCamera& c, ImageSize) { return FromColmap(c); },
      [](const ColmapCamera& c, ImageSize, const Vec3Array& world) {
        const auto [w, x, y, z] = c.quaternion;
        const double r[9] = {
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
            2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
        const Vec3Array p = Affine(r, c.translation.data(), world);
        return Pixel{c.fx * p[0] / p[2] + c.cx, c.fy * p[1] / p[2] + c.cy};
      });
}

TEST(CameraConventions, OpenGl) {
  ExpectAgrees(
      false, [](const Camera64& c, ImageSize s) { return ToOpenGl(c, s, 100); },
      [](const OpenGlCamera& c, ImageSize s) { return FromOpenGl(c, s); },
      [](const OpenGlCamera& c, ImageSize s, const Vec3Array& w) {
        double eye[4] = {}, clip[4] = {};
        const double world[4] = {w[0], w[1], w[2], 1};
        for (int i = 0; i < 16; ++i) eye[i / 4] += c.model_view[i] * world[i % 4];
        for (int i = 0; i < 16; ++i) clip[i / 4] += c.projection[i] * eye[i % 4];
        EXPECT_LT(std::abs(clip[2]), clip[3]);  // between the planes: depth 0.5 to 6
        return FromNdc(clip[0] / clip[3], clip[1] / clip[3], s);
      });
}

TEST(CameraConventions, OpenGlKeepsTheNearPlane) {
  Camera64 camera;
  camera.near_plane = 0.25;
  const auto there = Ok(ToOpenGl(camera, {64, 64}, 50));
  EXPECT_NEAR(FromOpenGl(*there, {64, 64}).value().near_plane, 0.25, 1e-12);
}

TEST(CameraConventions, Kaolin) {
  ExpectAgrees(
      true, [](const Camera64& c, ImageSize s) { return ToKaolin(c, s); },
      [](const KaolinCamera& c, ImageSize s) { return FromKaolin(c, s); },
      [](const KaolinCamera& c, ImageSize s, const Vec3Array& w) {
        const double zero[3] = {};
        const Vec3Array p =
            Affine(c.rotation.data(), zero,
                   {w[0] - c.position[0], w[1] - c.position[1], w[2] - c.position[2]});
        const double z = c.projection[2] * p[2];
        return FromNdc(c.projection[0] * p[0] / z, c.projection[1] * p[1] / z, s);
      });
}

TEST(CameraConventions, PyTorch3d) {
  ExpectAgrees(
      false, [](const Camera64& c, ImageSize s) { return ToPyTorch3d(c, s); },
      [](const PyTorch3dCamera& c, ImageSize s) { return FromPyTorch3d(c, s); },
      [](const PyTorch3dCamera& c, ImageSize s, const Vec3Array& w) {
        Vec3Array p = c.t;  // a row vector times r
        for (int i = 0; i < 9; ++i) p[i % 3] += w[i / 3] * c.r[i];
        EXPECT_GT(p[2], 0);
        const double half = 0.5 * std::min(s.width, s.height);
        const double x = c.focal_length[0] * p[0] / p[2] + c.principal_point[0];
        const double y = c.focal_length[1] * p[1] / p[2] + c.principal_point[1];
        return Pixel{0.5 * s.width - half * x, 0.5 * s.height - half * y};
      });
}

// Blender's way: the world in the camera's frame by the inverse of camera_to_world, which is solved
// for here, not transposed.
Vec3Array InFrame(const Mat4Array& m, const Vec3Array& w) {
  const glm::dvec3 x(m[0], m[4], m[8]), y(m[1], m[5], m[9]), z(m[2], m[6], m[10]);
  const glm::dvec3 d(w[0] - m[3], w[1] - m[7], w[2] - m[11]);
  const double det = glm::dot(x, glm::cross(y, z));
  return {glm::dot(d, glm::cross(y, z)) / det, glm::dot(x, glm::cross(d, z)) / det,
          glm::dot(x, glm::cross(y, d)) / det};
}

TEST(CameraConventions, Nerf) {
  ExpectAgrees(
      false, [](const Camera64& c, ImageSize) { return Result<NerfCamera>(ToNerf(c)); },
      [](const NerfCamera& c, ImageSize) { return FromNerf(c); },
      [](const NerfCamera& c, ImageSize, const Vec3Array& w) {
        const Vec3Array p = InFrame(c.camera_to_world, w);
        return Pixel{c.cx + c.fl_x * p[0] / -p[2], c.cy - c.fl_y * p[1] / -p[2]};
      });
}

// glTF 2.0, 3.10.3: 640 x 480, focal lengths of 500 and 400 pixels, at (1, 0, 4).
TEST(CameraConventions, Gltf) {
  GltfCamera from;
  from.node_to_world[3] = 1;
  from.node_to_world[11] = 4;
  from.yfov = 2 * std::atan(240 / 400.0);
  from.aspect_ratio = (320 / 500.0) / (240 / 400.0);
  const auto camera = Ok(FromGltf(from, {640, 480}));
  EXPECT_NEAR(camera->fx, 500, 1e-12);
  EXPECT_NEAR(camera->fy, 400, 1e-12);
  const Pixel at = Project(*camera, {0.4, 0.3, 0});
  EXPECT_NEAR(at.x, 320 - 500 * 0.6 / 4, 1e-12);
  EXPECT_NEAR(at.y, 240 - 400 * 0.3 / 4, 1e-12);
}

TEST(CameraConventions, GltfWithoutAspectHasSquarePixelsAndScaleDoesNotCount) {
  GltfCamera from;
  from.node_to_world = {3, 0, 0, 1, 0, 5, 0, 2, 0, 0, 7, 3, 0, 0, 0, 1};
  const auto camera = Ok(FromGltf(from, {640, 480}));
  EXPECT_EQ(camera->fx, camera->fy);
  EXPECT_EQ(camera->rotation[0], 1);
  EXPECT_EQ(camera->translation[2], -3);
}

void ExpectRefused(const Result<Camera64>& camera, const std::string& part) {
  ExpectMessage(camera.status(), part);
}

TEST(CameraConventions, WhatIsNoPinholeIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](void (*spoil)(OpenCvCamera&), const std::string& part) {
    OpenCvCamera camera;
    spoil(camera);
    ExpectRefused(FromOpenCv(camera), part);
  };
  refused([](OpenCvCamera& c) { c.k[1] = 0.5; }, "skew");
  refused([](OpenCvCamera& c) { c.k[8] = 2; }, "last row of K");
  refused([](OpenCvCamera& c) { c.k[0] = 0; }, "focal");
  refused([](OpenCvCamera& c) { c.k[0] = NAN; }, "focal");
  refused([](OpenCvCamera& c) { c.k[2] = NAN; }, "principal point");
  refused([](OpenCvCamera& c) { c.rotation[0] = 1.01; }, "rotation");
  refused([](OpenCvCamera& c) { c.rotation[0] = -1; }, "mirror");
  refused([](OpenCvCamera& c) { c.rotation = {}; }, "rotation");
  refused([](OpenCvCamera& c) { c.translation[1] = NAN; }, "finite");
  ExpectRefused(FromColmap({.quaternion = {0, 0, 0, 0}}), "quaternion");
  ExpectRefused(FromColmap({.quaternion = {nan, 0, 0, 0}}), "quaternion");
  NerfCamera nerf;
  nerf.camera_to_world[12] = 1;
  ExpectRefused(FromNerf(nerf), "row-major");
  nerf = {};
  nerf.camera_to_world[0] = 2;
  ExpectRefused(FromNerf(nerf), "scale");
  const ImageSize size{64, 48};
  ExpectRefused(FromOpenGl({}, size), "perspective");
  ExpectRefused(FromKaolin({}, {0, 48}), "0 x 48");
  ExpectRefused(FromKaolin({.projection = {1, 1, 1}}, size), "-1");
  ExpectRefused(FromPyTorch3d({.focal_length = {-1, 1}}, size), "focal");
  ExpectRefused(FromGltf({.yfov = 3.2}, size), "yfov");
  ExpectRefused(FromGltf({.aspect_ratio = nan}, size), "aspect");
  ExpectRefused(FromGltf({.znear = 0}, size), "near plane");
}

TEST(CameraConventions, WhatAConventionCannotSayIsRefused) {
  Camera64 camera;
  camera.cx = 30;
  EXPECT_FALSE(ToKaolin(camera, {64, 64}).ok());
  EXPECT_FALSE(ToOpenGl(camera, {64, 64}, camera.near_plane).ok());
  EXPECT_TRUE(ToPyTorch3d(camera, {64, 64}).ok());
}

// Cameras of other implementations: their matrices, and where points of the world land.
class CameraVectors : public testing::Test {
 protected:
  void SetUp() override {
    TILEGRAD_VECTORS_OR_SKIP(json, "08_cameras.json");
    data_ = json;
  }
  // Both axes span [-1, 1] on a square image; tolerance for numbers of order 1.
  void ExpectLands(const Camera64& camera, const Json& expected) {
    ASSERT_EQ(expected.size(), data_["points"].size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Pixel at = Project(camera, data_["points"][i].get<Vec3Array>());
      EXPECT_NEAR(at.x / 32 - 1, expected[i][0].get<double>(), 1e-12);
      EXPECT_NEAR(1 - at.y / 32, expected[i][1].get<double>(), 1e-12);
    }
  }
  Json data_;
};

Mat3Array Rows(const Json& rows) {
  Mat3Array out;
  for (int i = 0; i < 9; ++i) out[i] = rows[i / 3][i % 3].get<double>();
  return out;
}

TEST_F(CameraVectors, DibrAndBlender) {
  const double focal = data_["focal_for_49_134_deg"].get<double>();
  for (const char* block : {"dibr_camera_info", "author_blender_views"}) {
    for (const auto& view : data_[block]) {
      const auto camera = Ok(FromKaolin(
          {Rows(view["rot"]), view["cam_pos"].get<Vec3Array>(), {focal, focal, -1}}, {64, 64}));
      ExpectLands(*camera, view["points_image"]);
    }
  }
}

}  // namespace tilegrad::camera_conventions_test

// SPDX-License-Identifier: Apache-2.0
#include "scene/camera_conventions.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <iterator>

#include "base/error.h"

namespace tilegrad {
namespace {

Vec3Array Apply(const double* rotation, const Vec3Array& p) {
  Vec3Array out;
  for (int r = 0; r < 3; ++r) {
    out[r] = rotation[3 * r] * p[0] + rotation[3 * r + 1] * p[1] + rotation[3 * r + 2] * p[2];
  }
  return out;
}

Mat3Array Transposed(const double* m) {
  return {m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]};
}

struct Pose {
  Mat3Array rotation;
  Vec3Array translation;
};

void SetPose(const Pose& pose, Camera64* camera) {
  std::copy(pose.rotation.begin(), pose.rotation.end(), camera->rotation);
  std::copy(pose.translation.begin(), pose.translation.end(), camera->translation);
}

Pose PoseOf(const Camera64& camera) {
  Pose pose;
  std::copy_n(camera.rotation, 9, pose.rotation.begin());
  std::copy_n(camera.translation, 3, pose.translation.begin());
  return pose;
}

// The same pose with some of the camera's axes flipped.
Pose WithAxes(Pose pose, const Vec3Array& signs) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) pose.rotation[3 * r + c] *= signs[r];
    pose.translation[r] *= signs[r];
  }
  return pose;
}
constexpr Vec3Array kOpenCvAxes = {1, -1, -1}, kPyTorch3dAxes = {-1, 1, -1};

// World-to-camera pose from the camera's position.
Pose PoseAt(const Mat3Array& rotation, const Vec3Array& position) {
  Vec3Array translation = Apply(rotation.data(), position);
  for (double& t : translation) t = -t;
  return {rotation, translation};
}

Vec3Array PositionOf(const Camera64& camera) {
  Vec3Array position = Apply(Transposed(camera.rotation).data(),
                             {camera.translation[0], camera.translation[1], camera.translation[2]});
  for (double& p : position) p = -p;
  return position;
}

Mat4Array CameraToWorld(const Camera64& camera) {
  const Mat3Array axes = Transposed(camera.rotation);
  const Vec3Array at = PositionOf(camera);
  return {axes[0], axes[1], axes[2], at[0], axes[3], axes[4], axes[5], at[1],
          axes[6], axes[7], axes[8], at[2], 0,       0,       0,       1};
}

Status CheckLastRow(const Mat4Array& m, const char* what) {
  if (m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1) return {};
  return InvalidArgument(
      "{}: the last row is {} {} {} {}, not 0 0 0 1 (matrices are row-major here: transpose it?)",
      what, m[12], m[13], m[14], m[15]);
}

Result<Pose> PoseFromCameraToWorld(const Mat4Array& m, const char* what) {
  TILEGRAD_TRY(CheckLastRow(m, what));
  return PoseAt({m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]}, {m[3], m[7], m[11]});
}

Result<Camera64> Checked(const Camera64& camera) {
  TILEGRAD_TRY(Validate(camera));
  return camera;
}

Status CheckSize(ImageSize size) {
  if (size.width >= 1 && size.height >= 1) return {};
  return InvalidArgument("a camera needs the size of its image, got {} x {} pixels", size.width,
                         size.height);
}

Status CheckCentred(const Camera64& camera, ImageSize size, const char* convention) {
  const double off =
      std::max(std::abs(camera.cx - 0.5 * size.width), std::abs(camera.cy - 0.5 * size.height));
  if (off <= 1e-6 * std::max(size.width, size.height)) return {};
  return InvalidArgument(
      "{} has its principal point in the middle of the image, ({}, {}); this camera's is ({}, {})",
      convention, 0.5 * size.width, 0.5 * size.height, camera.cx, camera.cy);
}

double Determinant(const double* m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

Status CheckRotation(const double* m) {
  double off = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double dot = i == j ? -1 : 0;
      for (int c = 0; c < 3; ++c) dot += m[3 * i + c] * m[3 * j + c];
      off = std::max(off, std::abs(dot));
    }
  }
  if (off > kRotationTolerance) {
    return InvalidArgument(
        "the camera's rotation is not a rotation: its rows are off unit length and right angles by "
        "{:.3g}, {} is allowed (is there scale in the matrix?)",
        off, kRotationTolerance);
  }
  if (Determinant(m) > 0) return {};
  return InvalidArgument(
      "the camera's rotation is a mirror (determinant -1): one of its axes is flipped");
}

}  // namespace

Status Validate(const Camera64& camera) {
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::all_of(std::begin(camera.rotation), std::end(camera.rotation), finite) ||
      !std::all_of(std::begin(camera.translation), std::end(camera.translation), finite)) {
    return InvalidArgument("the camera's pose holds a number that is not finite");
  }
  TILEGRAD_TRY(CheckRotation(camera.rotation));
  if (!(finite(camera.fx) && finite(camera.fy) && camera.fx > 0 && camera.fy > 0)) {
    return InvalidArgument("the camera's focal lengths are {} and {} pixels; both must be above 0",
                           camera.fx, camera.fy);
  }
  if (!finite(camera.cx) || !finite(camera.cy))
    return InvalidArgument("the camera's principal point is not finite");
  if (!(finite(camera.near_plane) && camera.near_plane > 0))
    return InvalidArgument("the camera's near plane is {}; it must be above 0", camera.near_plane);
  return {};
}

// OpenCV, COLMAP ------------------------------------------------------------------------------

Result<Camera64> FromOpenCv(const OpenCvCamera& from) {
  const Mat3Array& k = from.k;
  if (k[1] != 0 || k[3] != 0) {
    return InvalidArgument("K has skew ({}, {}); cameras here have none", k[1], k[3]);
  }
  if (k[6] != 0 || k[7] != 0 || k[8] != 1) {
    return InvalidArgument("the last row of K is {} {} {}, not 0 0 1 (row-major)", k[6], k[7],
                           k[8]);
  }
  const double shift = from.centre == PixelCentre::kInteger ? 0.5 : 0.0;
  Camera64 camera;
  SetPose(WithAxes({from.rotation, from.translation}, kOpenCvAxes), &camera);
  camera.fx = k[0];
  camera.cx = k[2] + shift;
  camera.fy = k[4];
  camera.cy = k[5] + shift;
  return Checked(camera);
}

OpenCvCamera ToOpenCv(const Camera64& camera, PixelCentre centre) {
  const Pose pose = WithAxes(PoseOf(camera), kOpenCvAxes);
  const double shift = centre == PixelCentre::kInteger ? 0.5 : 0.0;
  return {{camera.fx, 0, camera.cx - shift, 0, camera.fy, camera.cy - shift, 0, 0, 1},
          pose.rotation,
          pose.translation,
          centre};
}

Mat3Array RotationFromVector(const Vec3Array& rvec) {
  const double angle = std::hypot(rvec[0], rvec[1], rvec[2]);
  if (angle == 0) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const glm::dmat3 m = glm::mat3_cast(
      glm::angleAxis(angle, glm::dvec3(rvec[0] / angle, rvec[1] / angle, rvec[2] / angle)));
  return {m[0][0], m[1][0], m[2][0], m[0][1], m[1][1], m[2][1], m[0][2], m[1][2], m[2][2]};
}

Result<Camera64> FromColmap(const ColmapCamera& from) {
  const auto& q = from.quaternion;
  const double length = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
  if (!(length > 0) || !std::isfinite(length)) {
    return InvalidArgument("the quaternion {} {} {} {} gives no rotation", q[0], q[1], q[2], q[3]);
  }
  const glm::dmat3 m =
      glm::mat3_cast(glm::dquat(q[0] / length, q[1] / length, q[2] / length, q[3] / length));
  OpenCvCamera cv;
  cv.k = {from.fx, 0, from.cx, 0, from.fy, from.cy, 0, 0, 1};
  cv.rotation = {m[0][0], m[1][0], m[2][0], m[0][1], m[1][1], m[2][1], m[0][2], m[1][2], m[2][2]};
  cv.translation = from.translation;
  cv.centre = PixelCentre::kHalf;
  return FromOpenCv(cv);
}

ColmapCamera ToColmap(const Camera64& camera) {
  const OpenCvCamera cv = ToOpenCv(camera, PixelCentre::kHalf);
  const auto& r = cv.rotation;
  const glm::dquat q =
      glm::quat_cast(glm::dmat3(r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]));
  return {{q.w, q.x, q.y, q.z}, cv.translation, cv.k[0], cv.k[4], cv.k[2], cv.k[5]};
}

// OpenGL, Kaolin ------------------------------------------------------------------------------

// P = | 2 fx/W   0      1 - 2 cx/W        0       |   x_ndc = 2 x/W - 1, y_ndc = 1 - 2 y/H
//     |  0     2 fy/H   2 cy/H - 1        0       |
//     |  0       0    -(f+n)/(f-n)   -2 f n/(f-n) |
//     |  0       0         -1             0       |
Result<Camera64> FromOpenGl(const OpenGlCamera& from, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  const Mat4Array& p = from.projection;
  if (p[12] != 0 || p[13] != 0 || p[14] != -1 || p[15] != 0) {
    return InvalidArgument(
        "the last row of the projection is {} {} {} {}, not 0 0 -1 0: not a perspective, or "
        "column-major (transpose it)",
        p[12], p[13], p[14], p[15]);
  }
  if (p[1] != 0 || p[4] != 0) return InvalidArgument("the projection has skew");
  TILEGRAD_TRY(CheckLastRow(from.model_view, "model_view"));
  const Mat4Array& m = from.model_view;
  Camera64 camera;
  SetPose({{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}}, &camera);
  camera.fx = 0.5 * size.width * p[0];
  camera.cx = 0.5 * size.width * (1 - p[2]);
  camera.fy = 0.5 * size.height * p[5];
  camera.cy = 0.5 * size.height * (1 + p[6]);
  camera.near_plane = p[11] / (p[10] - 1);
  return Checked(camera);
}

Result<OpenGlCamera> ToOpenGl(const Camera64& camera, ImageSize size, double far_plane) {
  TILEGRAD_TRY(CheckSize(size));
  const double n = camera.near_plane, f = far_plane;
  if (!(f > n) || !std::isfinite(f))
    return InvalidArgument("the far plane {} must be finite and beyond the near plane {}", f, n);
  const auto& r = camera.rotation;
  const auto& t = camera.translation;
  return OpenGlCamera{
      {2 * camera.fx / size.width, 0, 1 - 2 * camera.cx / size.width, 0, 0,
       2 * camera.fy / size.height, 2 * camera.cy / size.height - 1, 0, 0, 0, -(f + n) / (f - n),
       -2 * f * n / (f - n), 0, 0, -1, 0},
      {r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0, 0, 0, 1}};
}

Result<Camera64> FromKaolin(const KaolinCamera& from, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  if (from.projection[2] != -1) {
    return InvalidArgument("the third number of camera_proj is {}; it must be -1",
                           from.projection[2]);
  }
  Camera64 camera;
  SetPose(PoseAt(from.rotation, from.position), &camera);
  camera.fx = 0.5 * size.width * from.projection[0];
  camera.cx = 0.5 * size.width;
  camera.fy = 0.5 * size.height * from.projection[1];
  camera.cy = 0.5 * size.height;
  return Checked(camera);
}

Result<KaolinCamera> ToKaolin(const Camera64& camera, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  TILEGRAD_TRY(CheckCentred(camera, size, "Kaolin"));
  return KaolinCamera{PoseOf(camera).rotation,
                      PositionOf(camera),
                      {2 * camera.fx / size.width, 2 * camera.fy / size.height, -1}};
}

// PyTorch3D -----------------------------------------------------------------------------------

Result<Camera64> FromPyTorch3d(const PyTorch3dCamera& from, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  const double half = 0.5 * std::min(size.width, size.height);
  Camera64 camera;
  SetPose(WithAxes({Transposed(from.r.data()), from.t}, kPyTorch3dAxes), &camera);
  camera.fx = half * from.focal_length[0];
  camera.fy = half * from.focal_length[1];
  camera.cx = 0.5 * size.width - half * from.principal_point[0];
  camera.cy = 0.5 * size.height - half * from.principal_point[1];
  return Checked(camera);
}

Result<PyTorch3dCamera> ToPyTorch3d(const Camera64& camera, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  const double half = 0.5 * std::min(size.width, size.height);
  const Pose pose = WithAxes(PoseOf(camera), kPyTorch3dAxes);
  return PyTorch3dCamera{
      Transposed(pose.rotation.data()),
      pose.translation,
      {camera.fx / half, camera.fy / half},
      {(0.5 * size.width - camera.cx) / half, (0.5 * size.height - camera.cy) / half}};
}

// NeRF, glTF ----------------------------------------------------------------------------------

Result<Camera64> FromNerf(const NerfCamera& from) {
  Camera64 camera;
  TILEGRAD_ASSIGN(const Pose pose, PoseFromCameraToWorld(from.camera_to_world, "transform_matrix"));
  SetPose(pose, &camera);
  camera.fx = from.fl_x;
  camera.fy = from.fl_y;
  camera.cx = from.cx;
  camera.cy = from.cy;
  return Checked(camera);
}

NerfCamera ToNerf(const Camera64& camera) {
  return {CameraToWorld(camera), camera.fx, camera.fy, camera.cx, camera.cy};
}

Result<Camera64> FromGltf(const GltfCamera& from, ImageSize size) {
  TILEGRAD_TRY(CheckSize(size));
  if (!(from.yfov > 0 && from.yfov < 3.14159265)) {
    return InvalidArgument("yfov is {} radians; it must be between 0 and pi", from.yfov);
  }
  if (!(from.aspect_ratio >= 0) || !std::isfinite(from.aspect_ratio))
    return InvalidArgument("the aspect ratio is {}; it must be 0 or above", from.aspect_ratio);
  Mat4Array node = from.node_to_world;
  for (int c = 0; c < 3; ++c) {  // scale is ignored
    const double length = std::hypot(node[c], node[4 + c], node[8 + c]);
    if (length > 0) {
      node[c] /= length;
      node[4 + c] /= length;
      node[8 + c] /= length;
    }
  }
  Camera64 camera;
  TILEGRAD_ASSIGN(const Pose pose, PoseFromCameraToWorld(node, "the camera's node"));
  SetPose(pose, &camera);
  camera.fy = 0.5 * size.height / std::tan(0.5 * from.yfov);
  camera.fx = from.aspect_ratio > 0
                  ? 0.5 * size.width / (from.aspect_ratio * std::tan(0.5 * from.yfov))
                  : camera.fy;
  camera.cx = 0.5 * size.width;
  camera.cy = 0.5 * size.height;
  camera.near_plane = from.znear;
  return Checked(camera);
}

}  // namespace tilegrad

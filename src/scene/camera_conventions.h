// SPDX-License-Identifier: Apache-2.0
// Converts other programs' cameras to and from the one camera of the project (camera.h).
// docs/rendering.md has a picture and a number for each.
//
// All matrices are row-major and act on column vectors unless said otherwise; all lengths are world
// units. From... fails for input that is not a pinhole camera: a number that is not finite, a
// matrix that is not a rotation (rows off by more than kRotationTolerance, or a mirror), a focal
// length that is not positive, skew. To... fails where the other convention cannot express the
// camera. A round trip preserves the numbers up to a few roundings; conventions without a near
// plane get the default of camera.h.
#pragma once

#include <array>

#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad {

using Vec2Array = std::array<double, 2>;
using Vec3Array = std::array<double, 3>;
using Mat3Array = std::array<double, 9>;
using Mat4Array = std::array<double, 16>;

// Largest entry of |R R^T - 1| for which R still counts as a rotation, printed with few digits.
inline constexpr double kRotationTolerance = 1e-3;

// The coordinates of the first pixel's centre.
enum class PixelCentre {
  kInteger,  // (0, 0): OpenCV's calibration and projectPoints
  kHalf      // (0.5, 0.5): COLMAP, OpenGL, and this project
};

// OpenCV: p = rotation * world + translation, x right, y down, z forward; pixel = K p / p.z.
struct OpenCvCamera {
  Mat3Array k = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // fx 0 cx; 0 fy cy; 0 0 1
  Mat3Array rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vec3Array translation = {};
  PixelCentre centre = PixelCentre::kInteger;
};
Result<Camera64> FromOpenCv(const OpenCvCamera& from);
OpenCvCamera ToOpenCv(const Camera64& camera, PixelCentre centre = PixelCentre::kInteger);

// A rotation vector (axis times angle in radians; Rodrigues) as OpenCV's solvePnP returns it.
Mat3Array RotationFromVector(const Vec3Array& rvec);

// COLMAP's PINHOLE model and a line of images.txt: OpenCV's axes, pixel centres at +0.5.
struct ColmapCamera {
  std::array<double, 4> quaternion = {1, 0, 0, 0};  // w, x, y, z; world to camera; any length > 0
  Vec3Array translation = {};
  double fx = 1, fy = 1, cx = 0, cy = 0;
};
Result<Camera64> FromColmap(const ColmapCamera& from);
ColmapCamera ToColmap(const Camera64& camera);

// OpenGL: x right, y up, looking along -z; clip = projection * model_view * world. A matrix that
// glGetFloatv fills is the transpose of this one.
struct OpenGlCamera {
  Mat4Array projection = {};
  Mat4Array model_view = {};
};
Result<Camera64> FromOpenGl(const OpenGlCamera& from, ImageSize size);
// far_plane > camera.near_plane; this renderer has no far plane.
Result<OpenGlCamera> ToOpenGl(const Camera64& camera, ImageSize size, double far_plane);

// Kaolin's and DIB-R's: p = rotation * (world - position), OpenGL's axes; image in [-1, 1] =
// (projection.x * p.x, projection.y * p.y) / (projection.z * p.z), projection.z = -1. The principal
// point is the centre of the image.
struct KaolinCamera {
  Mat3Array rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vec3Array position = {};
  Vec3Array projection = {1, 1, -1};
};
Result<Camera64> FromKaolin(const KaolinCamera& from, ImageSize size);
Result<KaolinCamera> ToKaolin(const Camera64& camera, ImageSize size);

// PyTorch3D's PerspectiveCameras with in_ndc = True: row vectors p = world * r + t; x left, y up, z
// forward; NDC +x left, +y up, [-1, 1] over the shorter side of the image.
struct PyTorch3dCamera {
  Mat3Array r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vec3Array t = {};
  Vec2Array focal_length = {1, 1}, principal_point = {};
};
Result<Camera64> FromPyTorch3d(const PyTorch3dCamera& from, ImageSize size);
Result<PyTorch3dCamera> ToPyTorch3d(const Camera64& camera, ImageSize size);

// A frame of NeRF's transforms.json: camera to world, OpenGL's axes, pixel centres at +0.5.
struct NerfCamera {
  Mat4Array camera_to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  double fl_x = 1, fl_y = 1, cx = 0, cy = 0;  // pixels
};
Result<Camera64> FromNerf(const NerfCamera& from);
NerfCamera ToNerf(const Camera64& camera);

// glTF's perspective camera at a node: OpenGL's axes. Ignores the node's scale.
struct GltfCamera {
  Mat4Array node_to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  double yfov = 0.8;        // radians, the full vertical field of view, (0, pi)
  double aspect_ratio = 0;  // of the field of view; 0: that of the image, so that pixels are square
  double znear = 1e-2;
};
Result<Camera64> FromGltf(const GltfCamera& from, ImageSize size);

// The same view on an image of another size: scales all pixel units, keeps the field of view.
inline Camera64 ResizeCamera(const Camera64& camera, ImageSize from, ImageSize to) {
  Camera64 out = camera;
  const double x = static_cast<double>(to.width) / from.width;
  const double y = static_cast<double>(to.height) / from.height;
  out.fx *= x;
  out.cx *= x;
  out.fy *= y;
  out.cy *= y;
  return out;
}

// The camera of the same image with `scale` times as many pixels on each side.
inline Camera ScaledCamera(Camera camera, float scale) {
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx *= scale;
  camera.cy *= scale;
  return camera;
}

// Fails unless the camera is finite, its rotation is a rotation, and its focal lengths and near
// plane are positive. Every From... calls it last.
Status Validate(const Camera64& camera);

}  // namespace tilegrad

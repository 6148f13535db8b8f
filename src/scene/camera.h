// SPDX-License-Identifier: Apache-2.0
// The one camera of the project. docs/conventions.md has a picture and a number for each rule
// below.
#pragma once

namespace tilegrad {

// Pinhole camera: world to camera, then camera to pixels.
//
//   p_cam = rotation * p_world + translation    (rows of `rotation`: the camera's axes, world)
//   x = cx + fx * p_cam.x / -p_cam.z            (pixels from the left edge of the image)
//   y = cy - fy * p_cam.y / -p_cam.z            (pixels from the top edge of the image)
//
// Camera axes as OpenGL: x right, y up, the camera looks along -z, so visible points have a
// negative p_cam.z and depth = -p_cam.z. Pixel (column j, row i) has its centre at (j + 0.5, i +
// 0.5); row 0 is the top.
template <class T>
struct CameraT {
  T rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major, orthonormal
  T translation[3] = {0, 0, 0};                 // world units
  T fx = 64, fy = 64;                           // focal lengths, pixels
  T cx = 32, cy = 32;                           // principal point, pixels
  T near_plane = T(1e-2);                       // > 0, world units; what is nearer is clipped away
};
using Camera = CameraT<float>;
using Camera64 = CameraT<double>;  // what converters and camera files speak (camera_conventions.h)

struct ImageSize {
  int width = 0, height = 0;  // pixels
};

// The principal point is the middle of the image, pixels are square.
struct Lens {
  // Degrees, the whole vertical field of view. Blender's default (f = 35/16 of half the image's
  // height), with which the paper's images were rendered.
  double fov_y = 49.13434207744484;
  int width = 64, height = 64;  // pixels
};

// A camera at distance * (cos el cos az, sin el, cos el sin az) that looks at the origin with y up;
// degrees. Elevations of exactly +-90 take the limit from below (up is then the horizontal
// direction), so every finite input gives a rotation.
template <class T = float>  // or double
CameraT<T> OrbitCamera(const Lens& lens, double azimuth, double elevation, double distance);

// A camera at `eye` that looks at `target`. `up` need only be independent of the viewing direction;
// if it is not, another axis is taken. T: float or double.
template <class T>
CameraT<T> LookAtCamera(const Lens& lens, const T eye[3], const T target[3], const T up[3]);

// Element-wise conversion, e.g. to double for the reference.
template <class T, class U>
CameraT<T> CameraCast(const CameraT<U>& c) {
  CameraT<T> out;
  for (int i = 0; i < 9; ++i) out.rotation[i] = static_cast<T>(c.rotation[i]);
  for (int i = 0; i < 3; ++i) out.translation[i] = static_cast<T>(c.translation[i]);
  out.fx = static_cast<T>(c.fx), out.fy = static_cast<T>(c.fy);
  out.cx = static_cast<T>(c.cx), out.cy = static_cast<T>(c.cy);
  out.near_plane = static_cast<T>(c.near_plane);
  return out;
}

}  // namespace tilegrad

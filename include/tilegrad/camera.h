// SPDX-License-Identifier: Apache-2.0
// The camera. docs/conventions.md has a picture and a number for each rule below.
#pragma once

#include <type_traits>

#include "tilegrad/abi.h"
#include "tilegrad/status.h"

namespace tilegrad::inline v0 {

// Pinhole camera: world to camera, then camera to pixels.
//
//   p_cam = rotation * p_world + translation    (rows of `rotation`: the camera's axes, world)
//   x = cx + fx * p_cam.x / -p_cam.z            (pixels from the left edge of the image)
//   y = cy - fy * p_cam.y / -p_cam.z            (pixels from the top edge of the image)
//
// Axes as OpenGL: x right, y up, looking along -z; depth = -p_cam.z. Pixel (column j, row i) has
// its centre at (j + 0.5, i + 0.5); row 0 is the top.
//
// Render checks that the numbers are finite and in range (focal lengths: to 1e30), but not that
// `rotation` is a rotation: it applies any 3 x 3 matrix unchanged. A reflection (determinant -1, or
// one negative focal length) renders the mirror image and swaps front and back faces; with scale or
// shear, specular light still takes -rotation^T * translation as the eye, which is then not the
// point with p_cam = 0.
template <class T>
struct CameraT {
  T rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major, orthonormal
  T translation[3] = {0, 0, 0};                 // world units
  T fx = 64, fy = 64;                           // focal lengths, pixels; not 0, < 0 mirrors
  T cx = 32, cy = 32;                           // principal point, pixels
  T near_plane = T(1e-2);                       // > 0, world units; nearer geometry is clipped
};
using Camera = CameraT<float>;

// The principal point is the centre of the image; pixels are square.
struct Lens {
  // Degrees, the full vertical field of view, (0, 180). The default is Blender's (f = 35/16 of half
  // the image's height), with which the paper's images were rendered.
  double fov_y = 49.13434207744484;
  int width = 64, height = 64;  // pixels
};

// A camera at distance * (cos el cos az, sin el, cos el sin az) looking at the origin, y up.
struct Orbit {
  double azimuth = 0, elevation = 0;  // degrees
  double distance = 1;                // world units, > 0
};

// A camera at `eye` looking at `target`, in world coordinates. `up` need not be perpendicular to
// the view; if it is parallel, another axis replaces it.
struct LookAt {
  double eye[3] = {0, 0, 1};
  double target[3] = {0, 0, 0};
  double up[3] = {0, 1, 0};
};

// In the functions below T is float or double; both compute in double.

// MakeCamera<double>(lens, orbit) is for SceneT<double>. Errors: a number that is not finite or out
// of range, an eye at its target.
template <class T = float>
TILEGRAD_API Result<CameraT<T>> MakeCamera(const Lens& lens, const Orbit& orbit);
template <class T = float>
TILEGRAD_API Result<CameraT<T>> MakeLookAtCamera(const Lens& lens, const LookAt& look_at);

// A camera as free parameters for an optimiser. The rotation is six numbers, the first two rows of
// a matrix before orthonormalisation (Y. Zhou et al.: On the continuity of rotation representations
// in neural networks, 2019).
template <class T>
struct CameraParametersT {
  T rotation[6] = {1, 0, 0, 0, 1, 0};
  T translation[3] = {0, 0, 0};
  T fx = 64, fy = 64, cx = 32, cy = 32;
};
using CameraParameters = CameraParametersT<float>;

template <class T = float>
TILEGRAD_API CameraParametersT<T> ParametersOf(const CameraT<T>& camera);

// Errors: a number that is not finite; rows too short (1e-6 of a unit) or too nearly parallel (1e-6
// rad) to give a rotation; a focal length or near plane that is not positive.
template <class T = float>
TILEGRAD_API Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>& parameters,
                                                     std::type_identity_t<T> near_plane = T(1e-2));

// dL/d(parameters) from dL/d(camera). Accepts the same `parameters` as CameraFromParameters.
template <class T = float>
TILEGRAD_API CameraParametersT<T> PullBack(const CameraParametersT<T>& parameters,
                                           const std::type_identity_t<CameraT<T>>& d_camera);

}  // namespace tilegrad::inline v0

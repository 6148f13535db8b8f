// SPDX-License-Identifier: Apache-2.0
// Cameras of weak perspective (scaled orthography), as annotations of photographs have them: CMR
// (Kanazawa et al., ECCV 2018, section 2) and what came after it. Every point is seen at the same
// scale, whatever its depth.
//
//   p = rotation(quaternion) * world     axes: x right, y down, z away from the camera
//   x = translation[0] + scale * p.x,    y = translation[1] + scale * p.y,    depth = p.z
//
// Units of the image are the user's: pixels (the centre of the first one at (0.5, 0.5), as
// camera.h), or [-1, 1] across it.
#pragma once

#include <array>

#include "scene/camera_conventions.h"
#include "tilegrad/camera.h"
#include "tilegrad/status.h"

namespace tilegrad {

template <class T>
struct WeakPerspectiveT {
  T scale = 1;                                 // image units per world unit, > 0
  std::array<T, 2> translation = {};           // where the world's origin is seen
  std::array<T, 4> quaternion = {1, 0, 0, 0};  // w, x, y, z; world to camera; of any length > 0
};
using WeakPerspective = WeakPerspectiveT<double>;

// Row-major. T of the templates below: float, double, std::complex<double>.
template <class T>
std::array<T, 9> RotationOf(const std::array<T, 4>& quaternion);
// Unit, w >= 0. The rotation's rows are orthonormal, its determinant 1.
std::array<double, 4> QuaternionOf(const Mat3Array& rotation);

// x, y and depth of a point.
template <class T>
std::array<T, 3> ProjectWeakly(const WeakPerspectiveT<T>& camera, const std::array<T, 3>& point);
// Its adjoint: adds to *d_camera and *d_point what d_image [2] (x and y) is by them.
template <class T>
void ProjectWeaklyAdjoint(const WeakPerspectiveT<T>& camera, const std::array<T, 3>& point,
                          const std::array<T, 2>& d_image, WeakPerspectiveT<T>* d_camera,
                          std::array<T, 3>* d_point);

// The pinhole camera at `distance` (world units, > 0) that sees the plane through the origin in the
// same way; image units are pixels. A point at depth z of an object is seen at 1 / (1 + z /
// distance) of its offset from `translation`.
template <class T>
CameraT<T> PinholeOf(const WeakPerspectiveT<T>& camera, T distance);
// Its adjoint: d_pinhole entry by entry, as the renderer gives it. Overwrites *d_camera.
template <class T>
void PinholeOfAdjoint(const WeakPerspectiveT<T>& camera, T distance, const CameraT<T>& d_pinhole,
                      WeakPerspectiveT<T>* d_camera);

// Of a pinhole camera, as it sees the surroundings of `centre`. InvalidArgument if that is not in
// front of it, or if focal lengths differ by more than a hundredth.
Result<WeakPerspective> WeakPerspectiveOf(const Camera64& camera, const Vec3Array& centre);

// Sees a world mirrored at x = 0 as `camera` sees the world, flipped from left to right in an image
// of that width in pixels.
WeakPerspective MirroredCamera(const WeakPerspective& camera, double width);
// Of the image after x -> (x - left) * factor, y -> (y - top) * factor.
WeakPerspective CroppedCamera(const WeakPerspective& camera, double left, double top,
                              double factor);

}  // namespace tilegrad

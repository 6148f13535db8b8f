// SPDX-License-Identifier: Apache-2.0
// Weak-perspective cameras (scaled orthography), as in annotations of photographs: CMR (Kanazawa et
// al., ECCV 2018, section 2) and its successors. The scale is the same at every depth.
//
//   p = rotation(quaternion) * world     axes: x right, y down, z away from the camera
//   x = translation[0] + scale * p.x,    y = translation[1] + scale * p.y,    depth = p.z
//
// Image units are the caller's choice: pixels (first centre at (0.5, 0.5), as in camera.h), or [-1,
// 1] across the image.
#pragma once

#include <array>

#include "scene/camera_conventions.h"
#include "tilegrad/camera.h"
#include "tilegrad/status.h"

namespace tilegrad {

template <class T>
struct WeakPerspectiveT {
  T scale = 1;                                 // image units per world unit, > 0
  std::array<T, 2> translation = {};           // image of the world's origin
  std::array<T, 4> quaternion = {1, 0, 0, 0};  // w, x, y, z; world to camera; of any length > 0
};
using WeakPerspective = WeakPerspectiveT<double>;

// The rotation matrix (row-major, rows orthonormal, determinant 1) as a unit quaternion, w >= 0.
std::array<double, 4> QuaternionOf(const Mat3Array& rotation);

// Approximates a pinhole camera near `centre`. InvalidArgument if `centre` is not in front of it,
// or if the focal lengths differ by more than one hundredth.
Result<WeakPerspective> WeakPerspectiveOf(const Camera64& camera, const Vec3Array& centre);

// The camera for the world mirrored at x = 0 whose image is that of `camera` flipped horizontally,
// in an image `width` pixels wide.
WeakPerspective MirroredCamera(const WeakPerspective& camera, double width);
// The camera of the image after x -> (x - left) * factor, y -> (y - top) * factor.
WeakPerspective CroppedCamera(const WeakPerspective& camera, double left, double top,
                              double factor);

}  // namespace tilegrad

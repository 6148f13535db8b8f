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

// Row-major -> unit, w >= 0. The rotation's rows are orthonormal, its determinant 1.
std::array<double, 4> QuaternionOf(const Mat3Array& rotation);

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

// SPDX-License-Identifier: Apache-2.0
// Makes and converts cameras of the public interface.
#pragma once

#include <span>
#include <vector>

#include "tilegrad/camera.h"

namespace tilegrad {

using Camera64 = CameraT<double>;  // of converters and camera files (camera_conventions.h)

struct ImageSize {
  int width = 0, height = 0;  // pixels
};

// Like MakeCamera, for numbers that are finite and in range. At elevations of exactly +-90 takes
// the limit from below (up is then horizontal), so every finite input gives a rotation.
template <class T = float>  // or double
CameraT<T> OrbitCamera(const Lens& lens, double azimuth, double elevation, double distance);

// A camera at `eye` looking at `target`. `up` need not be perpendicular to the viewing direction;
// if it is parallel, another axis replaces it. T: float or double.
template <class T>
CameraT<T> LookAtCamera(const Lens& lens, const T eye[3], const T target[3], const T up[3]);

// Element-wise conversion, e.g. to double for the reference.
template <class T, class U>
CameraT<T> CameraCast(const CameraT<U>& c) {
  CameraT<T> out;
  for (int i = 0; i < 9; ++i) out.rotation[i] = static_cast<T>(c.rotation[i]);
  for (int i = 0; i < 3; ++i) out.translation[i] = static_cast<T>(c.translation[i]);
  out.fx = static_cast<T>(c.fx);
  out.fy = static_cast<T>(c.fy);
  out.cx = static_cast<T>(c.cx);
  out.cy = static_cast<T>(c.cy);
  out.near_plane = static_cast<T>(c.near_plane);
  return out;
}

}  // namespace tilegrad

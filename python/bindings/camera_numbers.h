// SPDX-License-Identifier: Apache-2.0
// A camera as the row of numbers that Python holds: rotation, translation, fx, fy, cx, cy, near
// plane.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "scene/camera.h"

namespace tilegrad::python {

inline constexpr std::size_t kCameraNumbers = 17;
using CameraRow = std::array<double, kCameraNumbers>;

inline CameraRow NumbersOf(const Camera64& c) {
  CameraRow out;
  std::copy_n(c.rotation, 9, out.begin());
  std::copy_n(c.translation, 3, out.begin() + 9);
  const double rest[] = {c.fx, c.fy, c.cx, c.cy, c.near_plane};
  std::copy_n(rest, 5, out.begin() + 12);
  return out;
}

inline Camera64 CameraOfNumbers(const CameraRow& numbers) {
  Camera64 out;
  std::copy_n(numbers.begin(), 9, out.rotation);
  std::copy_n(numbers.begin() + 9, 3, out.translation);
  out.fx = numbers[12];
  out.fy = numbers[13];
  out.cx = numbers[14];
  out.cy = numbers[15];
  out.near_plane = numbers[16];
  return out;
}

}  // namespace tilegrad::python

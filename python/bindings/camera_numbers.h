// SPDX-License-Identifier: Apache-2.0
// A camera as the row of numbers that Python holds: rotation, translation, fx, fy, cx, cy, near
// plane.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "scene/camera.h"

namespace tilegrad::python {

inline constexpr std::size_t kCameraNumbers = 17;
using CameraRow = std::array<double, kCameraNumbers>;

template <class T>
void PutCamera(const CameraT<T>& c, std::span<T> numbers) {
  std::copy_n(c.rotation, 9, numbers.begin());
  std::copy_n(c.translation, 3, numbers.begin() + 9);
  const T rest[] = {c.fx, c.fy, c.cx, c.cy, c.near_plane};
  std::copy_n(rest, 5, numbers.begin() + 12);
}
template <class T>
CameraT<T> CameraOf(std::span<const T> numbers) {
  CameraT<T> out;
  std::copy_n(numbers.begin(), 9, out.rotation);
  std::copy_n(numbers.begin() + 9, 3, out.translation);
  T* const rest[] = {&out.fx, &out.fy, &out.cx, &out.cy, &out.near_plane};
  for (std::size_t i = 0; i < 5; ++i) *rest[i] = numbers[12 + i];
  return out;
}

inline CameraRow NumbersOf(const Camera64& c) {
  CameraRow out;
  PutCamera<double>(c, out);
  return out;
}
inline Camera64 CameraOfNumbers(const CameraRow& numbers) { return CameraOf<double>(numbers); }

}  // namespace tilegrad::python

// SPDX-License-Identifier: Apache-2.0
// The cameras of weak_perspective.h as templates over the number type: float, double,
// std::complex<double>.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>

#include "scene/weak_perspective.h"

namespace tilegrad {

namespace weak_ref {

template <class T>
std::array<T, 4> UnitQuaternion(const std::array<T, 4>& q) {
  const T inverse = T(1) / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] * inverse, q[1] * inverse, q[2] * inverse, q[3] * inverse};
}

// Adjoint of RotationOf: adds to *d_q. First the gradient by the unit quaternion, whose rotation
// has the entries 2 (..), then through its normalisation.
template <class T>
void AddRotationAdjoint(const std::array<T, 4>& q, const std::array<T, 9>& d,
                        std::array<T, 4>* d_q) {
  const auto [w, x, y, z] = UnitQuaternion(q);
  const T two(2);
  const std::array<T, 4> d_unit = {
      two * (z * (d[3] - d[1]) + y * (d[2] - d[6]) + x * (d[7] - d[5])),
      two * (y * (d[1] + d[3]) + z * (d[2] + d[6]) + w * (d[7] - d[5]) - two * x * (d[4] + d[8])),
      two * (x * (d[1] + d[3]) + z * (d[5] + d[7]) + w * (d[2] - d[6]) - two * y * (d[0] + d[8])),
      two * (x * (d[2] + d[6]) + y * (d[5] + d[7]) + w * (d[3] - d[1]) - two * z * (d[0] + d[4]))};
  const T along = w * d_unit[0] + x * d_unit[1] + y * d_unit[2] + z * d_unit[3];
  const T inverse = T(1) / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const std::array<T, 4> unit = {w, x, y, z};
  for (std::size_t i = 0; i < 4; ++i) (*d_q)[i] += inverse * (d_unit[i] - along * unit[i]);
}

// r p, with r row-major.
template <class T>
std::array<T, 3> Rotate(const std::array<T, 9>& r, const std::array<T, 3>& p) {
  return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
          r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
}

// Signs of the pinhole's axes (y up, z towards the camera) in ours.
inline constexpr int kAxisSigns[3] = {1, -1, -1};

}  // namespace weak_ref

// Row-major.
template <class T>
std::array<T, 9> RotationOf(const std::array<T, 4>& quaternion) {
  const auto [w, x, y, z] = weak_ref::UnitQuaternion(quaternion);
  const T one(1), two(2);
  return {one - two * (y * y + z * z), two * (x * y - w * z),       two * (x * z + w * y),
          two * (x * y + w * z),       one - two * (x * x + z * z), two * (y * z - w * x),
          two * (x * z - w * y),       two * (y * z + w * x),       one - two * (x * x + y * y)};
}

// x, y and depth of a point, in image and world units.
template <class T>
std::array<T, 3> ProjectWeakly(const WeakPerspectiveT<T>& camera, const std::array<T, 3>& point) {
  const std::array<T, 3> p = weak_ref::Rotate(RotationOf(camera.quaternion), point);
  return {camera.translation[0] + camera.scale * p[0], camera.translation[1] + camera.scale * p[1],
          p[2]};
}

// Its adjoint for d_image [2] (x and y): adds to *d_camera and *d_point.
template <class T>
void ProjectWeaklyAdjoint(const WeakPerspectiveT<T>& camera, const std::array<T, 3>& point,
                          const std::array<T, 2>& d_image, WeakPerspectiveT<T>* d_camera,
                          std::array<T, 3>* d_point) {
  const std::array<T, 9> r = RotationOf(camera.quaternion);
  const std::array<T, 3> p = weak_ref::Rotate(r, point);
  std::array<T, 9> d_rotation{};
  for (std::size_t row = 0; row < 2; ++row) {
    d_camera->translation[row] += d_image[row];
    d_camera->scale += d_image[row] * p[row];
    for (std::size_t c = 0; c < 3; ++c) {
      d_rotation[3 * row + c] = camera.scale * d_image[row] * point[c];
      (*d_point)[c] += camera.scale * d_image[row] * r[3 * row + c];
    }
  }
  weak_ref::AddRotationAdjoint(camera.quaternion, d_rotation, &d_camera->quaternion);
}

// The pinhole camera at `distance` (world units, > 0) with the same image of the plane through the
// origin; image units are pixels. A point at depth z scales its offset from `translation` by 1 / (1
// + z / distance).
template <class T>
CameraT<T> PinholeOf(const WeakPerspectiveT<T>& camera, T distance) {
  const std::array<T, 9> r = RotationOf(camera.quaternion);
  CameraT<T> out;
  for (std::size_t i = 0; i < 9; ++i) out.rotation[i] = T(weak_ref::kAxisSigns[i / 3]) * r[i];
  out.translation[2] = -distance;
  out.fx = out.fy = camera.scale * distance;
  out.cx = camera.translation[0];
  out.cy = camera.translation[1];
  return out;
}

// Its adjoint: d_pinhole per entry, as the renderer gives it. Overwrites *d_camera.
template <class T>
void PinholeOfAdjoint(const WeakPerspectiveT<T>& camera, T distance, const CameraT<T>& d_pinhole,
                      WeakPerspectiveT<T>* d_camera) {
  std::array<T, 9> d_rotation;
  for (std::size_t i = 0; i < 9; ++i)
    d_rotation[i] = T(weak_ref::kAxisSigns[i / 3]) * d_pinhole.rotation[i];
  *d_camera = {distance * (d_pinhole.fx + d_pinhole.fy), {d_pinhole.cx, d_pinhole.cy}, {}};
  d_camera->quaternion = {};
  weak_ref::AddRotationAdjoint(camera.quaternion, d_rotation, &d_camera->quaternion);
}

}  // namespace tilegrad

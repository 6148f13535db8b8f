// SPDX-License-Identifier: Apache-2.0
// A camera from free parameters, for gradient descent, and its adjoint. T: float, double,
// std::complex<double>.
//
// The rotation comes from six numbers by Gram and Schmidt (Y. Zhou et al., On the continuity of
// rotation representations in neural networks, CVPR 2019, equation 15), here as rows:
//
//   x = a / |a|,   u = b - (x . b) x,   y = u / |u|,   z = x cross y
//
// which is smooth wherever a and b are independent, unlike angles and quaternions. Scaling a, or
// adding a multiple of it to b, changes nothing: gradients along these directions are 0.
#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

#include "scene/camera.h"

namespace tilegrad {

namespace camera_ref {

template <class T>
using V3 = std::array<T, 3>;

template <class T>
T Dot(const V3<T>& a, const V3<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
template <class T>
V3<T> Cross(const V3<T>& a, const V3<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
// a + s b
template <class T>
V3<T> AddScaled(const V3<T>& a, T s, const V3<T>& b) {
  return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]};
}
template <class T>
V3<T> Unit(const V3<T>& v) {
  const T inverse = T(1) / std::sqrt(Dot(v, v));
  return {v[0] * inverse, v[1] * inverse, v[2] * inverse};
}
// Adjoint of Unit: (d - (unit . d) unit) / |v|.
template <class T>
V3<T> UnitAdjoint(const V3<T>& v, const V3<T>& unit, const V3<T>& d) {
  const T inverse = T(1) / std::sqrt(Dot(v, v));
  const V3<T> across = AddScaled(d, -Dot(unit, d), unit);
  return {across[0] * inverse, across[1] * inverse, across[2] * inverse};
}

template <class T>
struct GramSchmidt {
  V3<T> a, b, x, u, y, z;
};
template <class T>
GramSchmidt<T> Orthogonalize(const T (&r)[6]) {
  GramSchmidt<T> g;
  g.a = {r[0], r[1], r[2]};
  g.b = {r[3], r[4], r[5]};
  g.x = Unit(g.a);
  g.u = AddScaled(g.b, -Dot(g.x, g.b), g.x);
  g.y = Unit(g.u);
  g.z = Cross(g.x, g.y);
  return g;
}

}  // namespace camera_ref

template <class T>
CameraT<T> CameraFromParametersRef(const CameraParametersT<T>& p, T near_plane) {
  const auto g = camera_ref::Orthogonalize(p.rotation);
  CameraT<T> camera;
  for (std::size_t c = 0; c < 3; ++c) {
    camera.rotation[c] = g.x[c];
    camera.rotation[3 + c] = g.y[c];
    camera.rotation[6 + c] = g.z[c];
    camera.translation[c] = p.translation[c];
  }
  camera.fx = p.fx;
  camera.fy = p.fy;
  camera.cx = p.cx;
  camera.cy = p.cy;
  camera.near_plane = near_plane;
  return camera;
}

// d_camera: per entry, as the renderer gives it. Overwrites *d_p.
template <class T>
void CameraFromParametersAdjointRef(const CameraParametersT<T>& p, const CameraT<T>& d_camera,
                                    CameraParametersT<T>* d_p) {
  using camera_ref::AddScaled, camera_ref::Cross, camera_ref::Dot;
  const auto g = camera_ref::Orthogonalize(p.rotation);
  const T* const d = d_camera.rotation;
  const camera_ref::V3<T> d_z = {d[6], d[7], d[8]};
  auto d_x = AddScaled({d[0], d[1], d[2]}, T(1), Cross(g.y, d_z));
  const auto d_y = AddScaled({d[3], d[4], d[5]}, T(1), Cross(d_z, g.x));
  const auto d_u = camera_ref::UnitAdjoint(g.u, g.y, d_y);
  const auto d_b = AddScaled(d_u, -Dot(g.x, d_u), g.x);
  d_x = AddScaled(AddScaled(d_x, -Dot(g.x, g.b), d_u), -Dot(g.x, d_u), g.b);
  const auto d_a = camera_ref::UnitAdjoint(g.a, g.x, d_x);
  for (std::size_t c = 0; c < 3; ++c) {
    d_p->rotation[c] = d_a[c];
    d_p->rotation[3 + c] = d_b[c];
    d_p->translation[c] = d_camera.translation[c];
  }
  d_p->fx = d_camera.fx;
  d_p->fy = d_camera.fy;
  d_p->cx = d_camera.cx;
  d_p->cy = d_camera.cy;
}

}  // namespace tilegrad

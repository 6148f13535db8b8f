// SPDX-License-Identifier: Apache-2.0
#include "scene/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

namespace tilegrad {
namespace {

Camera64 FromAxes(const Lens& lens, glm::dvec3 x, glm::dvec3 y, glm::dvec3 z, glm::dvec3 eye) {
  Camera64 camera;
  const glm::dvec3 rows[3] = {x, y, z};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) camera.rotation[3 * r + c] = rows[r][c];
    camera.translation[r] = -glm::dot(rows[r], eye);
  }
  camera.fx = camera.fy = 0.5 * lens.height / std::tan(0.5 * glm::radians(lens.fov_y));
  camera.cx = 0.5 * lens.width;
  camera.cy = 0.5 * lens.height;
  return camera;
}

// Times a power of two, so that squares of its numbers neither vanish nor overflow.
glm::dvec3 Scaled(glm::dvec3 v) {
  const double most = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(most > 0) || !std::isfinite(most)) return v;
  const int exponent = -std::ilogb(most);
  return {std::ldexp(v.x, exponent), std::ldexp(v.y, exponent), std::ldexp(v.z, exponent)};
}

Camera64 LookAlong(const Lens& lens, glm::dvec3 eye, glm::dvec3 backward, glm::dvec3 up) {
  backward = Scaled(backward);
  up = Scaled(up);
  const double length = glm::length(backward);
  const glm::dvec3 z = length > 0 ? backward / length : glm::dvec3(0, 0, 1);
  glm::dvec3 x = glm::cross(up, z);
  // `up` along the view: take the world axis that is most across it.
  if (glm::length(x) <= 1e-12 * glm::length(up) || glm::length(x) == 0) {
    x = glm::cross(std::abs(z.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0), z);
  }
  x = glm::normalize(x);
  return FromAxes(lens, x, glm::cross(z, x), z, eye);
}

}  // namespace

template <class T>
CameraT<T> OrbitCamera(const Lens& lens, double azimuth, double elevation, double distance) {
  const double az = glm::radians(azimuth), el = glm::radians(elevation);
  const glm::dvec3 outward(std::cos(el) * std::cos(az), std::sin(el), std::cos(el) * std::sin(az));
  // (0,1,0) x outward is cos(el) * (sin az, 0, -cos az); the factor is dropped, which also serves
  // the poles.
  const glm::dvec3 x(std::sin(az), 0.0, -std::cos(az));
  return CameraCast<T>(FromAxes(lens, x, glm::cross(outward, x), outward, distance * outward));
}

template <class T>
CameraT<T> LookAtCamera(const Lens& lens, const T eye[3], const T target[3], const T up[3]) {
  const glm::dvec3 e(eye[0], eye[1], eye[2]), t(target[0], target[1], target[2]);
  return CameraCast<T>(LookAlong(lens, e, e - t, glm::dvec3(up[0], up[1], up[2])));
}

#define TILEGRAD_INSTANTIATE(T)                                            \
  template CameraT<T> OrbitCamera<T>(const Lens&, double, double, double); \
  template CameraT<T> LookAtCamera(const Lens&, const T[3], const T[3], const T[3]);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad

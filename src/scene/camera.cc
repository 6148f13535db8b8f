// SPDX-License-Identifier: Apache-2.0
#include "scene/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/scalar.h"
#include "scene/camera_conventions.h"
#include "scene/camera_ref.h"

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

// Scaled by a power of two, so that squares of its numbers neither underflow nor overflow.
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
  // `up` is parallel to the view: take the world axis most perpendicular to it.
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

TILEGRAD_INSTANTIATE(OrbitCamera);
TILEGRAD_INSTANTIATE(LookAtCamera);

}  // namespace tilegrad

namespace tilegrad::inline v0 {
namespace {

constexpr double kLeastLength = 1e-6;

template <class T, class U>
CameraParametersT<T> ParametersCast(const CameraParametersT<U>& p) {
  CameraParametersT<T> out;
  const auto cast = [](U x) { return static_cast<T>(x); };
  std::transform(std::begin(p.rotation), std::end(p.rotation), out.rotation, cast);
  std::transform(std::begin(p.translation), std::end(p.translation), out.translation, cast);
  out.fx = static_cast<T>(p.fx);
  out.fy = static_cast<T>(p.fy);
  out.cx = static_cast<T>(p.cx);
  out.cy = static_cast<T>(p.cy);
  return out;
}

// The part of b across a, over |b|, is the sine of the angle between them.
Status CheckIndependent(const CameraParametersT<double>& p) {
  const auto g = camera_ref::Orthogonalize(p.rotation);
  const double a = std::sqrt(camera_ref::Dot(g.a, g.a)), b = std::sqrt(camera_ref::Dot(g.b, g.b));
  const double across = std::sqrt(camera_ref::Dot(g.u, g.u));
  if (a >= kLeastLength && b >= kLeastLength && across >= kLeastLength * b) return {};
  return InvalidArgument(
      "the six numbers of the rotation, ({}, {}, {}) and ({}, {}, {}), are too short or parallel: "
      "they give no rotation",
      g.a[0], g.a[1], g.a[2], g.b[0], g.b[1], g.b[2]);
}

Status CheckLens(const Lens& lens) {
  if (!(lens.fov_y > 0 && lens.fov_y < 180)) {
    return InvalidArgument("lens.fov_y is {}, must be in (0, 180) degrees", lens.fov_y);
  }
  if (lens.width >= 1 && lens.height >= 1) return {};
  return InvalidArgument("lens is for {} x {} pixels, must be at least 1 x 1", lens.width,
                         lens.height);
}

Status CheckOrbit(const Orbit& orbit) {
  if (!std::isfinite(orbit.azimuth) || !std::isfinite(orbit.elevation)) {
    return InvalidArgument("orbit has azimuth {} and elevation {}, must be finite", orbit.azimuth,
                           orbit.elevation);
  }
  if (orbit.distance > 0 && std::isfinite(orbit.distance)) return {};
  return InvalidArgument("orbit.distance is {}, must be finite and > 0", orbit.distance);
}

Status CheckLookAt(const LookAt& look_at) {
  const std::pair<const char*, std::span<const double, 3>> points[] = {
      {"eye", look_at.eye}, {"target", look_at.target}, {"up", look_at.up}};
  for (const auto& [name, p] : points) {
    if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) continue;
    return InvalidArgument("look_at.{} is {} {} {}, must be finite", name, p[0], p[1], p[2]);
  }
  if (!std::equal(std::begin(look_at.eye), std::end(look_at.eye), look_at.target)) return {};
  return InvalidArgument(
      "look_at.eye and look_at.target coincide: the viewing direction is undefined");
}

// Errors: a number that T cannot hold.
template <class T>
Result<CameraT<T>> InRange(const Camera64& camera) {
  const auto& t = camera.translation;
  for (const double x : {camera.fx, t[0], t[1], t[2]}) {
    if (std::abs(x) <= std::numeric_limits<T>::max()) continue;
    return InvalidArgument("the camera has focal length {} and translation {} {} {}: out of range",
                           camera.fx, t[0], t[1], t[2]);
  }
  return CameraCast<T>(camera);
}

template <class T>
Result<CameraT<T>> MakeChecked(const CameraParametersT<T>& parameters, T near_plane) {
  const auto p = ParametersCast<double>(parameters);
  if (!std::all_of(std::begin(p.rotation), std::end(p.rotation),
                   [](double x) { return std::isfinite(x); })) {
    return InvalidArgument("a number of the camera's rotation is not finite");
  }
  TILEGRAD_TRY(CheckIndependent(p));
  const Camera64 camera = CameraFromParametersRef(p, static_cast<double>(near_plane));
  TILEGRAD_TRY(Validate(camera));
  return CameraCast<T>(camera);
}

}  // namespace

template <class T>
Result<CameraT<T>> MakeCamera(const Lens& lens, const Orbit& orbit) {
  return GuardedResult<CameraT<T>>([&]() -> Result<CameraT<T>> {
    TILEGRAD_TRY(CheckLens(lens));
    TILEGRAD_TRY(CheckOrbit(orbit));
    return InRange<T>(OrbitCamera<double>(lens, orbit.azimuth, orbit.elevation, orbit.distance));
  });
}

template <class T>
Result<CameraT<T>> MakeLookAtCamera(const Lens& lens, const LookAt& look_at) {
  return GuardedResult<CameraT<T>>([&]() -> Result<CameraT<T>> {
    TILEGRAD_TRY(CheckLens(lens));
    TILEGRAD_TRY(CheckLookAt(look_at));
    return InRange<T>(LookAtCamera(lens, look_at.eye, look_at.target, look_at.up));
  });
}

template <class T>
CameraParametersT<T> ParametersOf(const CameraT<T>& camera) {
  CameraParametersT<T> p;
  std::copy_n(camera.rotation, 6, p.rotation);
  std::copy_n(camera.translation, 3, p.translation);
  p.fx = camera.fx;
  p.fy = camera.fy;
  p.cx = camera.cx;
  p.cy = camera.cy;
  return p;
}

template <class T>
Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>& parameters,
                                        std::type_identity_t<T> near_plane) {
  return GuardedResult<CameraT<T>>([&] { return MakeChecked<T>(parameters, near_plane); });
}

template <class T>
CameraParametersT<T> PullBack(const CameraParametersT<T>& parameters,
                              const std::type_identity_t<CameraT<T>>& d_camera) {
  CameraParametersT<double> d;
  CameraFromParametersAdjointRef(ParametersCast<double>(parameters), CameraCast<double>(d_camera),
                                 &d);
  return ParametersCast<T>(d);
}

TILEGRAD_INSTANTIATE(MakeCamera);
TILEGRAD_INSTANTIATE(MakeLookAtCamera);
TILEGRAD_INSTANTIATE(ParametersOf);
TILEGRAD_INSTANTIATE(CameraFromParameters);
TILEGRAD_INSTANTIATE(PullBack);

}  // namespace tilegrad::inline v0

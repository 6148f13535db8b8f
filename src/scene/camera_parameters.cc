// SPDX-License-Identifier: Apache-2.0
#include "scene/camera_parameters.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "scene/camera_conventions.h"

namespace tilegrad {
namespace {

constexpr double kLeastLength = 1e-6;

template <class T, class U>
CameraParametersT<T> ParametersCast(const CameraParametersT<U>& p) {
  CameraParametersT<T> out;
  std::transform(p.rotation.begin(), p.rotation.end(), out.rotation.begin(),
                 [](U x) { return static_cast<T>(x); });
  std::transform(p.translation.begin(), p.translation.end(), out.translation.begin(),
                 [](U x) { return static_cast<T>(x); });
  out.fx = static_cast<T>(p.fx), out.fy = static_cast<T>(p.fy);
  out.cx = static_cast<T>(p.cx), out.cy = static_cast<T>(p.cy);
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

}  // namespace

template <class T>
CameraParametersT<T> ParametersOf(const CameraT<T>& camera) {
  CameraParametersT<T> p;
  std::copy_n(camera.rotation, 6, p.rotation.begin());
  std::copy_n(camera.translation, 3, p.translation.begin());
  p.fx = camera.fx, p.fy = camera.fy, p.cx = camera.cx, p.cy = camera.cy;
  return p;
}

template <class T>
Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>& parameters,
                                        std::type_identity_t<T> near_plane) {
  const auto p = ParametersCast<double>(parameters);
  if (!std::all_of(p.rotation.begin(), p.rotation.end(), [](double x) { return std::isfinite(x); }))
    return InvalidArgument("a number of the camera's rotation is not finite");
  TILEGRAD_TRY(CheckIndependent(p));
  const Camera64 camera = CameraFromParametersRef(p, static_cast<double>(near_plane));
  TILEGRAD_TRY(Validate(camera));
  return CameraCast<T>(camera);
}

template <class T>
void PullBack(const CameraParametersT<T>& parameters,
              const std::type_identity_t<CameraT<T>>& d_camera,
              std::type_identity_t<CameraParametersT<T>>* d_parameters) {
  CameraParametersT<double> d;
  CameraFromParametersAdjointRef(ParametersCast<double>(parameters), CameraCast<double>(d_camera),
                                 &d);
  *d_parameters = ParametersCast<T>(d);
}

#define TILEGRAD_INSTANTIATE(T)                                                        \
  template CameraParametersT<T> ParametersOf(const CameraT<T>&);                       \
  template Result<CameraT<T>> CameraFromParameters<T>(const CameraParametersT<T>&, T); \
  template void PullBack<T>(const CameraParametersT<T>&, const CameraT<T>&, CameraParametersT<T>*);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad

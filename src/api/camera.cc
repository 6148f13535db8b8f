// SPDX-License-Identifier: Apache-2.0
#include "tilegrad/camera.h"

#include <algorithm>
#include <cmath>

#include "api/guarded.h"
#include "base/error.h"
#include "scene/camera_parameters.h"

namespace tilegrad::v0 {
namespace {

namespace engine = ::tilegrad;

// Cameras and their parameters have the same members here and there.
template <class To, class From>
To CopyRest(const From& from, To to) {
  to.fx = from.fx, to.fy = from.fy, to.cx = from.cx, to.cy = from.cy;
  std::copy_n(std::begin(from.rotation), std::size(from.rotation), std::begin(to.rotation));
  std::copy_n(std::begin(from.translation), 3, std::begin(to.translation));
  return to;
}

template <class To, class From>
To CopyCamera(const From& from) {
  To to = CopyRest(from, To());
  to.near_plane = from.near_plane;
  return to;
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

}  // namespace

template <class T>
Result<CameraT<T>> MakeCamera(const Lens& lens, const Orbit& orbit) {
  CameraT<T> camera;
  const Status status = Guarded([&]() -> Status {
    TILEGRAD_TRY(CheckLens(lens));
    TILEGRAD_TRY(CheckOrbit(orbit));
    camera = CopyCamera<CameraT<T>>(engine::OrbitCamera<T>(
        {lens.fov_y, lens.width, lens.height}, orbit.azimuth, orbit.elevation, orbit.distance));
    return {};
  });
  if (!status.ok()) return status;
  return camera;
}

template <class T>
CameraParametersT<T> ParametersOf(const CameraT<T>& camera) {
  return CopyRest(engine::ParametersOf(CopyCamera<engine::CameraT<T>>(camera)),
                  CameraParametersT<T>());
}

template <class T>
Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>& parameters,
                                        std::type_identity_t<T> near_plane) {
  CameraT<T> camera;
  const Status status = Guarded([&]() -> Status {
    TILEGRAD_ASSIGN(const engine::CameraT<T> made,
                    engine::CameraFromParameters(
                        CopyRest(parameters, engine::CameraParametersT<T>()), near_plane));
    camera = CopyCamera<CameraT<T>>(made);
    return {};
  });
  if (!status.ok()) return status;
  return camera;
}

template <class T>
CameraParametersT<T> PullBack(const CameraParametersT<T>& parameters,
                              const std::type_identity_t<CameraT<T>>& d_camera) {
  engine::CameraParametersT<T> d_parameters;
  engine::PullBack(CopyRest(parameters, engine::CameraParametersT<T>()),
                   CopyCamera<engine::CameraT<T>>(d_camera), &d_parameters);
  return CopyRest(d_parameters, CameraParametersT<T>());
}

#define TILEGRAD_INSTANTIATE(T)                                                     \
  template Result<CameraT<T>> MakeCamera<T>(const Lens&, const Orbit&);             \
  template CameraParametersT<T> ParametersOf(const CameraT<T>&);                    \
  template Result<CameraT<T>> CameraFromParameters(const CameraParametersT<T>&, T); \
  template CameraParametersT<T> PullBack(const CameraParametersT<T>&, const CameraT<T>&);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::v0

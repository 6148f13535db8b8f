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

Result<Camera> MakeCamera(const Lens& lens, const Orbit& orbit) {
  Camera camera;
  const Status status = Guarded([&]() -> Status {
    TILEGRAD_TRY(CheckLens(lens));
    TILEGRAD_TRY(CheckOrbit(orbit));
    camera = CopyCamera<Camera>(engine::OrbitCamera(
        {lens.fov_y, lens.width, lens.height}, orbit.azimuth, orbit.elevation, orbit.distance));
    return {};
  });
  if (!status.ok()) return status;
  return camera;
}

CameraParameters ParametersOf(const Camera& camera) {
  return CopyRest(engine::ParametersOf(CopyCamera<engine::Camera>(camera)), CameraParameters());
}

Result<Camera> CameraFromParameters(const CameraParameters& parameters, float near_plane) {
  Camera camera;
  const Status status = Guarded([&]() -> Status {
    TILEGRAD_ASSIGN(
        const engine::Camera made,
        engine::CameraFromParameters(CopyRest(parameters, engine::CameraParameters()), near_plane));
    camera = CopyCamera<Camera>(made);
    return {};
  });
  if (!status.ok()) return status;
  return camera;
}

CameraParameters PullBack(const CameraParameters& parameters, const Camera& d_camera) {
  engine::CameraParameters d_parameters;
  engine::PullBack(CopyRest(parameters, engine::CameraParameters()),
                   CopyCamera<engine::Camera>(d_camera), &d_parameters);
  return CopyRest(d_parameters, CameraParameters());
}

}  // namespace tilegrad::v0

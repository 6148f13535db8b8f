// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "scene/camera_conventions.h"

namespace tilegrad {
namespace {

double Determinant(const double* m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

Status CheckRotation(const double* m) {
  double off = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double dot = i == j ? -1 : 0;
      for (int c = 0; c < 3; ++c) dot += m[3 * i + c] * m[3 * j + c];
      off = std::max(off, std::abs(dot));
    }
  }
  if (off > kRotationTolerance) {
    return InvalidArgument(
        "the camera's rotation is not a rotation: its rows are off unit length and right angles by "
        "{:.3g}, {} is allowed (is there scale in the matrix?)",
        off, kRotationTolerance);
  }
  if (Determinant(m) > 0) return {};
  return InvalidArgument(
      "the camera's rotation is a mirror (determinant -1): one of its axes is flipped");
}

}  // namespace

Status Validate(const Camera64& camera) {
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::all_of(std::begin(camera.rotation), std::end(camera.rotation), finite) ||
      !std::all_of(std::begin(camera.translation), std::end(camera.translation), finite)) {
    return InvalidArgument("the camera's pose holds a number that is not finite");
  }
  TILEGRAD_TRY(CheckRotation(camera.rotation));
  if (!(finite(camera.fx) && finite(camera.fy) && camera.fx > 0 && camera.fy > 0)) {
    return InvalidArgument("the camera's focal lengths are {} and {} pixels; both must be above 0",
                           camera.fx, camera.fy);
  }
  if (!finite(camera.cx) || !finite(camera.cy))
    return InvalidArgument("the camera's principal point is not finite");
  if (!(finite(camera.near_plane) && camera.near_plane > 0))
    return InvalidArgument("the camera's near plane is {}; it must be above 0", camera.near_plane);
  return {};
}

}  // namespace tilegrad

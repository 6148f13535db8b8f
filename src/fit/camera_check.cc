// SPDX-License-Identifier: Apache-2.0
#include "fit/camera_check.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

// Lenses that see from 179.9 degrees to a hundred-thousandth of one.
constexpr double kLeastFocal = 5e-4, kMostFocal = 1e7;  // longer sides of the image
constexpr double kMostOffCentre = 1e4;                  // longer sides of the image
constexpr double kFarthest = 1e9;                       // world units

}  // namespace

Status CheckCamera(const Camera64& camera, ImageSize image) {
  TILEGRAD_TRY(Validate(camera));
  const double side = std::max(image.width, image.height);
  const double least = kLeastFocal * side, most = kMostFocal * side;
  for (const double focal : {camera.fx, camera.fy}) {
    if (focal >= least && focal <= most) continue;
    return InvalidArgument(
        "the camera's focal lengths are {:.6g} and {:.6g} pixels; a fit takes {:.3g} to {:.3g} for "
        "an image of {} x {}",
        camera.fx, camera.fy, least, most, image.width, image.height);
  }
  const double off = std::max(std::abs(camera.cx), std::abs(camera.cy));
  if (off > kMostOffCentre * side) {
    return InvalidArgument(
        "the camera's principal point is ({:.6g}, {:.6g}), far from an image of "
        "{} x {} pixels",
        camera.cx, camera.cy, image.width, image.height);
  }
  const double* t = camera.translation;
  const double distance = std::hypot(t[0], t[1], t[2]);
  if (distance <= kFarthest) return {};
  return InvalidArgument(
      "the camera is {:.6g} from the world's origin; a fit takes cameras up to {:g} away: scale or "
      "move them",
      distance, kFarthest);
}

}  // namespace tilegrad::train

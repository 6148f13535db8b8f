// SPDX-License-Identifier: Apache-2.0
#include "scene/weak_perspective.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "scene/weak_perspective_ref.h"

namespace tilegrad {

// Shepperd's method: takes the largest of w, x, y, z from the diagonal; the others follow without
// loss.
std::array<double, 4> QuaternionOf(const Mat3Array& r) {
  const double diagonal[4] = {1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8],
                              1 - r[0] + r[4] - r[8], 1 - r[0] - r[4] + r[8]};
  const auto largest = std::max_element(diagonal, diagonal + 4) - diagonal;
  const double twice = std::sqrt(diagonal[largest]), f = 0.5 / twice;
  const double wx = f * (r[7] - r[5]), wy = f * (r[2] - r[6]), wz = f * (r[3] - r[1]);
  const double xy = f * (r[1] + r[3]), xz = f * (r[2] + r[6]), yz = f * (r[5] + r[7]);
  std::array<double, 4> q = {0.5 * twice, wx, wy, wz};
  if (largest == 1) q = {wx, 0.5 * twice, xy, xz};
  if (largest == 2) q = {wy, xy, 0.5 * twice, yz};
  if (largest == 3) q = {wz, xz, yz, 0.5 * twice};
  if (q[0] < 0) {
    for (double& c : q) c = -c;
  }
  return weak_ref::UnitQuaternion(q);
}

Result<WeakPerspective> WeakPerspectiveOf(const Camera64& camera, const Vec3Array& centre) {
  TILEGRAD_TRY(Validate(camera));
  if (std::abs(camera.fx - camera.fy) > 0.01 * camera.fy)
    return InvalidArgument("focal lengths {} and {}: weak perspective has one scale", camera.fx,
                           camera.fy);
  Mat3Array rotation;
  for (std::size_t i = 0; i < 9; ++i)
    rotation[i] = weak_ref::kAxisSigns[i / 3] * camera.rotation[i];
  const Vec3Array p = weak_ref::Rotate(rotation, centre);
  const double x = p[0] + camera.translation[0], y = p[1] - camera.translation[1];
  const double depth = p[2] - camera.translation[2];
  if (!(depth > camera.near_plane))
    return InvalidArgument("the object's centre is not in front of the camera");
  WeakPerspective out;
  out.scale = std::sqrt(camera.fx * camera.fy) / depth;
  out.translation = {camera.cx + camera.fx * x / depth - out.scale * p[0],
                     camera.cy + camera.fy * y / depth - out.scale * p[1]};
  out.quaternion = QuaternionOf(rotation);
  return out;
}

// diag(-1, 1, 1) R diag(-1, 1, 1) turns by the opposite angle about y and z.
WeakPerspective MirroredCamera(const WeakPerspective& camera, double width) {
  const auto& [w, x, y, z] = camera.quaternion;
  return {camera.scale, {width - camera.translation[0], camera.translation[1]}, {w, x, -y, -z}};
}

WeakPerspective CroppedCamera(const WeakPerspective& camera, double left, double top,
                              double factor) {
  return {camera.scale * factor,
          {(camera.translation[0] - left) * factor, (camera.translation[1] - top) * factor},
          camera.quaternion};
}

}  // namespace tilegrad

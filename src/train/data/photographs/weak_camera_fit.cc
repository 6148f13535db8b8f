// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/factorization.h"
#include "train/dense.h"

namespace tilegrad::train {
namespace {

using PlanePoint = std::array<double, 3>;

// scale, x, y, and a turn about each axis of the camera.
struct Linearized {
  NormalEquations equations{6};
  double squares = 0;
};

Linearized Linearize(const std::vector<PlanePoint>& shape, const std::vector<Keypoint>& keypoints,
                     const WeakPerspective& camera) {
  Linearized out;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    if (!keypoints[k].visible) continue;
    const PlanePoint seen = ProjectWeakly(camera, shape[k]);
    const double s = camera.scale, x = (seen[0] - camera.translation[0]) / s,
                 y = (seen[1] - camera.translation[1]) / s, z = seen[2];
    const std::array<double, 6> rows[2] = {{x, 1, 0, 0, s * z, -s * y},
                                           {y, 0, 1, -s * z, 0, s * x}};
    const double residuals[2] = {keypoints[k].x - seen[0], keypoints[k].y - seen[1]};
    for (int r = 0; r < 2; ++r) {
      out.equations.Add(rows[r], residuals[r]);
      out.squares += residuals[r] * residuals[r];
    }
  }
  return out;
}

// quaternion(turn) * q for a small turn.
std::array<double, 4> Turned(const std::array<double, 4>& q, double x, double y, double z) {
  const std::array<double, 4> t = {1, x / 2, y / 2, z / 2};
  return weak_ref::UnitQuaternion<double>({t[0] * q[0] - t[1] * q[1] - t[2] * q[2] - t[3] * q[3],
                                           t[0] * q[1] + t[1] * q[0] + t[2] * q[3] - t[3] * q[2],
                                           t[0] * q[2] - t[1] * q[3] + t[2] * q[0] + t[3] * q[1],
                                           t[0] * q[3] + t[1] * q[2] - t[2] * q[1] + t[3] * q[0]});
}

WeakPerspective Moved(const WeakPerspective& camera, const std::vector<double>& by) {
  WeakPerspective out = camera;
  out.scale = std::max(camera.scale + by[0], 0.1 * camera.scale);
  out.translation[0] += by[1];
  out.translation[1] += by[2];
  out.quaternion = Turned(camera.quaternion, by[3], by[4], by[5]);
  return out;
}

}  // namespace

WeakPerspective FitWeakCamera(const std::vector<PlanePoint>& shape,
                              const std::vector<Keypoint>& keypoints, WeakPerspective camera) {
  Linearized at = Linearize(shape, keypoints, camera);
  double damping = 1e-3;
  for (int step = 0; step < 60 && damping < 1e8; ++step) {
    NormalEquations damped = at.equations;
    for (std::size_t i = 0; i < 6; ++i)
      damped.Diagonal(i) += damping * (at.equations.Diagonal(i) + 1e-9);
    const auto by = damped.Solve();
    if (!by) {
      damping *= 10;
      continue;
    }
    const WeakPerspective next = Moved(camera, *by);
    const Linearized there = Linearize(shape, keypoints, next);
    if (!(there.squares < at.squares)) {
      damping *= 10;
      continue;
    }
    const bool settled = at.squares - there.squares < 1e-12 * at.squares;
    camera = next;
    at = there;
    damping *= 0.2;
    if (settled) break;
  }
  return camera;
}

double WeakCameraError(const std::vector<PlanePoint>& shape, const std::vector<Keypoint>& keypoints,
                       const WeakPerspective& camera) {
  const auto visible = std::ranges::count_if(keypoints, &Keypoint::visible);
  const double squares = Linearize(shape, keypoints, camera).squares;
  return visible > 0 ? std::sqrt(squares / static_cast<double>(visible)) : 0;
}

}  // namespace tilegrad::train

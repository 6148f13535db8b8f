// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/factorization.h"

namespace tilegrad::train {
namespace {

using PlanePoint = std::array<double, 3>;

// scale, x, y, and a turn about each axis of the camera.
using Vector6 = Eigen::Vector<double, 6>;
struct NormalEquations {
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 b = Vector6::Zero();
  double squares = 0;
};

NormalEquations Build(const std::vector<PlanePoint>& shape, const std::vector<Keypoint>& keypoints,
                      const WeakPerspective& camera) {
  NormalEquations out;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    if (!keypoints[k].visible) continue;
    const PlanePoint seen = ProjectWeakly(camera, shape[k]);
    const double s = camera.scale, x = (seen[0] - camera.translation[0]) / s,
                 y = (seen[1] - camera.translation[1]) / s, z = seen[2];
    const Vector6 rows[2] = {{x, 1, 0, 0, s * z, -s * y}, {y, 0, 1, -s * z, 0, s * x}};
    const double residuals[2] = {keypoints[k].x - seen[0], keypoints[k].y - seen[1]};
    for (int r = 0; r < 2; ++r) {
      out.a += rows[r] * rows[r].transpose();
      out.b += rows[r] * residuals[r];
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

WeakPerspective Moved(const WeakPerspective& camera, const Vector6& by) {
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
  NormalEquations at = Build(shape, keypoints, camera);
  double damping = 1e-3;
  for (int step = 0; step < 60 && damping < 1e8; ++step) {
    Eigen::Matrix<double, 6, 6> a = at.a;
    a.diagonal().array() += damping * (at.a.diagonal().array() + 1e-9);
    // Where `a` is not positive what comes is no number, and no better.
    const WeakPerspective next = Moved(camera, a.llt().solve(at.b));
    const NormalEquations there = Build(shape, keypoints, next);
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
  const double squares = Build(shape, keypoints, camera).squares;
  return visible > 0 ? std::sqrt(squares / static_cast<double>(visible)) : 0;
}

}  // namespace tilegrad::train

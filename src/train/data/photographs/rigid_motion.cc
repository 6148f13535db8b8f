// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/rigid_motion.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/points3.h"

namespace tilegrad::train {
namespace {

using points3::Cross, points3::Dot, points3::Point, points3::Unit, points3::operator+,
    points3::operator*;
using Views = KeypointRows;

constexpr int kAffineRounds = 60, kRigidRounds = 40;
constexpr double kRidge = 1e-3;  // of motions, in parts of a view's weight

// Two rows of a 3 x 3 map, and a shift.
struct Motion {
  std::array<Point, 2> rows{};
  std::array<double, 2> shift{};
};

Eigen::Map<const Eigen::Vector3d> VectorOf(const Point& p) {
  return Eigen::Map<const Eigen::Vector3d>(p.data());
}

// x of a x = b with a symmetric and positive definite; zeros where it is not.
template <int N>
Eigen::Vector<double, N> SolvePositive(const Eigen::Matrix<double, N, N>& a,
                                       const Eigen::Vector<double, N>& b) {
  const Eigen::LLT<Eigen::Matrix<double, N, N>> root(a);
  if (root.info() != Eigen::Success) return Eigen::Vector<double, N>::Zero();
  return root.solve(b);
}

struct Affine {
  std::vector<Motion> motions;
  std::vector<Point> shape;
  double squares = 0;
};

// Of one view: [S 1] -> x and y by least squares.
Motion FitMotion(const std::vector<Point>& shape, const std::vector<Keypoint>& view) {
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b[2] = {Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
  double weight = 0;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    if (!view[k].visible) continue;
    const Eigen::Vector4d row(shape[k][0], shape[k][1], shape[k][2], 1);
    a += row * row.transpose();
    b[0] += row * view[k].x;
    b[1] += row * view[k].y;
    weight += 1;
  }
  a.diagonal().array() += kRidge * weight;
  Motion out;
  for (std::size_t r = 0; r < 2; ++r) {
    const Eigen::Vector4d x = SolvePositive<4>(a, b[r]);
    out.rows[r] = {x[0], x[1], x[2]};
    out.shift[r] = x[3];
  }
  return out;
}

// Of one keypoint, over all views that see it. Stays where none does.
void FitPoint(const std::vector<Motion>& motions, const Views& views, std::size_t k, Point* point) {
  Eigen::Matrix3d a = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!views[v][k].visible) continue;
    for (std::size_t r = 0; r < 2; ++r) {
      const double want = (r == 0 ? views[v][k].x : views[v][k].y) - motions[v].shift[r];
      const auto row = VectorOf(motions[v].rows[r]);
      a += row * row.transpose();
      b += row * want;
    }
  }
  const Eigen::Vector3d x = SolvePositive<3>(a, b);
  *point = {x[0], x[1], x[2]};
}

double Squares(const std::vector<Motion>& motions, const std::vector<Point>& shape,
               const Views& views) {
  double sum = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t k = 0; k < shape.size(); ++k) {
      if (!views[v][k].visible) continue;
      const Motion& m = motions[v];
      const double x = Dot(m.rows[0], shape[k]) + m.shift[0] - views[v][k].x;
      const double y = Dot(m.rows[1], shape[k]) + m.shift[1] - views[v][k].y;
      sum += x * x + y * y;
    }
  }
  return sum;
}

Affine Alternate(const Views& views, std::uint64_t seed) {
  Affine out;
  Rng rng(seed, /*stream=*/0x736661);
  out.shape.resize(views[0].size());
  for (Point& p : out.shape) p = {rng.Normal(), rng.Normal(), rng.Normal()};
  out.motions.resize(views.size());
  for (int round = 0; round < kAffineRounds; ++round) {
    for (std::size_t v = 0; v < views.size(); ++v) out.motions[v] = FitMotion(out.shape, views[v]);
    for (std::size_t k = 0; k < out.shape.size(); ++k)
      FitPoint(out.motions, views, k, &out.shape[k]);
  }
  out.squares = Squares(out.motions, out.shape, views);
  return out;
}

// a Q b as a row over the six numbers of a symmetric Q.
Eigen::Vector<double, 6> QuadraticRow(const Point& a, const Point& b) {
  return {a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0],
          a[1] * b[1], a[1] * b[2] + a[2] * b[1], a[2] * b[2]};
}

// A 3 x 3 map after which the two rows of each motion are as long as each other and orthogonal, as
// well as that goes: A of M -> M A.
Eigen::Matrix3d MetricUpgrade(const std::vector<Motion>& motions) {
  using Vector6 = Eigen::Vector<double, 6>;
  const auto weight = static_cast<double>(motions.size());
  Eigen::Matrix<double, 6, 6> a = 1e-12 * weight * Eigen::Matrix<double, 6, 6>::Identity();
  Vector6 mean = Vector6::Zero();
  for (const Motion& m : motions) {
    const Vector6 first = QuadraticRow(m.rows[0], m.rows[0]),
                  second = QuadraticRow(m.rows[1], m.rows[1]),
                  both = QuadraticRow(m.rows[0], m.rows[1]), difference = first - second;
    mean += (first + second) / (2 * weight);
    a += difference * difference.transpose() + 4 * both * both.transpose();
  }
  a += weight * mean * mean.transpose();
  const Vector6 q = SolvePositive<6>(a, weight * mean);
  const Eigen::Matrix3d metric{{q[0], q[1], q[2]}, {q[1], q[3], q[4]}, {q[2], q[4], q[5]}};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(metric);
  const double least = 1e-4 * std::max(parts.eigenvalues().maxCoeff(), 1e-300);
  return parts.eigenvectors() * parts.eigenvalues().cwiseMax(least).cwiseSqrt().asDiagonal();
}

// The scaled rotation nearest to two rows: (M M^T)^(-1/2) M.
WeakPerspective NearestCamera(const Motion& m) {
  const double cross = Dot(m.rows[0], m.rows[1]);
  const Eigen::Matrix2d products{{Dot(m.rows[0], m.rows[0]), cross},
                                 {cross, Dot(m.rows[1], m.rows[1])}};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> parts(products);
  const Eigen::Vector2d roots = parts.eigenvalues().cwiseMax(1e-12).cwiseSqrt();
  const Eigen::Matrix2d inverse =
      parts.eigenvectors() * roots.cwiseInverse().asDiagonal() * parts.eigenvectors().transpose();
  Point rows[2];
  for (int r = 0; r < 2; ++r) rows[r] = inverse(r, 0) * m.rows[0] + inverse(r, 1) * m.rows[1];
  const Point x = Unit(rows[0]), z = Unit(Cross(x, rows[1])), y = Cross(z, x);
  WeakPerspective out;
  out.scale = 0.5 * roots.sum();
  out.translation = m.shift;
  out.quaternion = QuaternionOf({x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]});
  return out;
}

Motion MotionOf(const WeakPerspective& camera) {
  const Mat3Array r = RotationOf(camera.quaternion);
  const double s = camera.scale;
  return {{Point{s * r[0], s * r[1], s * r[2]}, Point{s * r[3], s * r[4], s * r[5]}},
          camera.translation};
}

RigidMotion MakeRigid(const Affine& affine, const Views& views) {
  const Eigen::Matrix3d a = MetricUpgrade(affine.motions);
  RigidMotion out;
  std::vector<Motion> motions;
  for (const Motion& m : affine.motions) {
    Motion upgraded{{}, m.shift};
    for (std::size_t r = 0; r < 2; ++r) {
      const Eigen::Vector3d row = a.transpose() * VectorOf(m.rows[r]);
      upgraded.rows[r] = {row[0], row[1], row[2]};
    }
    out.cameras.push_back(NearestCamera(upgraded));
    motions.push_back(MotionOf(out.cameras.back()));
  }
  out.shape.resize(affine.shape.size());
  for (int round = 0; round < kRigidRounds; ++round) {
    for (std::size_t k = 0; k < out.shape.size(); ++k) FitPoint(motions, views, k, &out.shape[k]);
    for (std::size_t v = 0; v < views.size(); ++v) {
      out.cameras[v] = FitWeakCamera(out.shape, views[v], out.cameras[v]);
      motions[v] = MotionOf(out.cameras[v]);
    }
  }
  out.squares = Squares(motions, out.shape, views);
  return out;
}

}  // namespace

RigidMotion FindRigidMotion(const Views& views, std::uint64_t seed) {
  return MakeRigid(Alternate(views, seed), views);
}

Point LocateKeypoint(const Views& views, const std::vector<WeakPerspective>& cameras,
                     std::size_t k) {
  std::vector<Motion> motions;
  for (const WeakPerspective& camera : cameras) motions.push_back(MotionOf(camera));
  Point out = {};
  FitPoint(motions, views, k, &out);
  return out;
}

}  // namespace tilegrad::train

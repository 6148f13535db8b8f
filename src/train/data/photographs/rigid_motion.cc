// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/rigid_motion.h"

#include <algorithm>
#include <cmath>

#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/points3.h"
#include "train/data/photographs/small_systems.h"

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

struct Affine {
  std::vector<Motion> motions;
  std::vector<Point> shape;
  double squares = 0;
};

// Of one view: [S 1] -> x and y by least squares.
Motion FitMotion(const std::vector<Point>& shape, const std::vector<Keypoint>& view) {
  Matrix<4> a{};
  Vector<4> b[2] = {};
  double weight = 0;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    if (!view[k].visible) continue;
    const Vector<4> row = {shape[k][0], shape[k][1], shape[k][2], 1};
    AddOuter(row, 1, &a);
    for (std::size_t i = 0; i < 4; ++i)
      b[0][i] += row[i] * view[k].x, b[1][i] += row[i] * view[k].y;
    weight += 1;
  }
  for (std::size_t i = 0; i < 4; ++i) a[i][i] += kRidge * weight;
  Motion out;
  for (std::size_t r = 0; r < 2; ++r) {
    const Vector<4> x = SolvePositive(a, b[r]);
    out.rows[r] = {x[0], x[1], x[2]}, out.shift[r] = x[3];
  }
  return out;
}

// Of one keypoint, over all views that see it. Stays where none does.
void FitPoint(const std::vector<Motion>& motions, const Views& views, std::size_t k, Point* point) {
  Matrix<3> a{};
  Vector<3> b{};
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!views[v][k].visible) continue;
    for (std::size_t r = 0; r < 2; ++r) {
      const double want = (r == 0 ? views[v][k].x : views[v][k].y) - motions[v].shift[r];
      AddOuter(motions[v].rows[r], 1, &a);
      for (std::size_t i = 0; i < 3; ++i) b[i] += motions[v].rows[r][i] * want;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) a[i][i] += 1e-9;
  *point = SolvePositive(a, b);
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
Vector<6> QuadraticRow(const Point& a, const Point& b) {
  return {a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0],
          a[1] * b[1], a[1] * b[2] + a[2] * b[1], a[2] * b[2]};
}

// A 3 x 3 map after which the two rows of each motion are as long as each other and orthogonal, as
// well as that goes. Columns of the result: A of M -> M A.
Matrix<3> MetricUpgrade(const std::vector<Motion>& motions) {
  Matrix<6> a{};
  Vector<6> mean{};
  for (const Motion& m : motions) {
    const Vector<6> first = QuadraticRow(m.rows[0], m.rows[0]),
                    second = QuadraticRow(m.rows[1], m.rows[1]);
    Vector<6> difference;
    for (std::size_t i = 0; i < 6; ++i) {
      difference[i] = first[i] - second[i];
      mean[i] += (first[i] + second[i]) / static_cast<double>(2 * motions.size());
    }
    AddOuter(difference, 1, &a);
    AddOuter(QuadraticRow(m.rows[0], m.rows[1]), 4, &a);
  }
  const auto weight = static_cast<double>(motions.size());
  AddOuter(mean, weight, &a);
  Vector<6> b;
  for (std::size_t i = 0; i < 6; ++i) b[i] = weight * mean[i], a[i][i] += 1e-12 * weight;
  const Vector<6> q = SolvePositive(a, b);
  Vector<3> values;
  Matrix<3> vectors;
  Eigen<3>({{{q[0], q[1], q[2]}, {q[1], q[3], q[4]}, {q[2], q[4], q[5]}}}, &values, &vectors);
  const double largest = std::max({values[0], values[1], values[2], 1e-300});
  for (std::size_t c = 0; c < 3; ++c) {
    const double root = std::sqrt(std::max(values[c], 1e-4 * largest));
    for (std::size_t r = 0; r < 3; ++r) vectors[r][c] *= root;
  }
  return vectors;
}

// The scaled rotation nearest to two rows: (M M^T)^(-1/2) M.
WeakPerspective NearestCamera(const Motion& m) {
  Vector<2> values;
  Matrix<2> vectors;
  const double cross = Dot(m.rows[0], m.rows[1]);
  Eigen<2>({{{Dot(m.rows[0], m.rows[0]), cross}, {cross, Dot(m.rows[1], m.rows[1])}}}, &values,
           &vectors);
  Point rows[2] = {};
  for (std::size_t i = 0; i < 2; ++i) {
    const double inverse = 1 / std::sqrt(std::max(values[i], 1e-12));
    for (std::size_t r = 0; r < 2; ++r) {
      for (std::size_t c = 0; c < 2; ++c)
        rows[r] = rows[r] + (inverse * vectors[r][i] * vectors[c][i]) * m.rows[c];
    }
  }
  const Point x = Unit(rows[0]), z = Unit(Cross(x, rows[1])), y = Cross(z, x);
  WeakPerspective out;
  out.scale = 0.5 * (std::sqrt(std::max(values[0], 1e-12)) + std::sqrt(std::max(values[1], 1e-12)));
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
  const Matrix<3> a = MetricUpgrade(affine.motions);
  RigidMotion out;
  std::vector<Motion> motions;
  for (const Motion& m : affine.motions) {
    Motion upgraded{{}, m.shift};
    for (std::size_t r = 0; r < 2; ++r) {
      for (std::size_t c = 0; c < 3; ++c)
        upgraded.rows[r][c] =
            m.rows[r][0] * a[0][c] + m.rows[r][1] * a[1][c] + m.rows[r][2] * a[2][c];
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

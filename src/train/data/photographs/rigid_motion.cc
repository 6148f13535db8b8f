// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/rigid_motion.h"

#include <algorithm>
#include <cmath>

#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/factorization.h"
#include "train/dense.h"
#include "train/points3.h"

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

// Zeros where the equations have no single solution.
std::vector<double> SolutionOf(const NormalEquations& equations) {
  return equations.Solve().value_or(std::vector<double>(equations.b.size()));
}

struct Affine {
  std::vector<Motion> motions;
  std::vector<Point> shape;
  double squares = 0;
};

// Of one view: [S 1] -> x and y by least squares.
Motion FitMotion(const std::vector<Point>& shape, const std::vector<Keypoint>& view) {
  NormalEquations coordinates[2] = {NormalEquations(4), NormalEquations(4)};
  double weight = 0;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    if (!view[k].visible) continue;
    const std::array<double, 4> row = {shape[k][0], shape[k][1], shape[k][2], 1};
    coordinates[0].Add(row, view[k].x);
    coordinates[1].Add(row, view[k].y);
    weight += 1;
  }
  Motion out;
  for (std::size_t r = 0; r < 2; ++r) {
    for (std::size_t i = 0; i < 4; ++i) coordinates[r].Diagonal(i) += kRidge * weight;
    const std::vector<double> x = SolutionOf(coordinates[r]);
    out.rows[r] = {x[0], x[1], x[2]};
    out.shift[r] = x[3];
  }
  return out;
}

// Of one keypoint, over all views that see it. Stays where none does.
void FitPoint(const std::vector<Motion>& motions, const Views& views, std::size_t k, Point* point) {
  NormalEquations equations(3);
  for (std::size_t i = 0; i < 3; ++i) equations.Diagonal(i) = 1e-9;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!views[v][k].visible) continue;
    for (std::size_t r = 0; r < 2; ++r) {
      const double want = (r == 0 ? views[v][k].x : views[v][k].y) - motions[v].shift[r];
      equations.Add(motions[v].rows[r], want);
    }
  }
  const std::vector<double> x = SolutionOf(equations);
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
using Row6 = std::array<double, 6>;
Row6 QuadraticRow(const Point& a, const Point& b) {
  return {a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0],
          a[1] * b[1], a[1] * b[2] + a[2] * b[1], a[2] * b[2]};
}

// Equations over Q: the two rows of each motion are as long as each other and orthogonal, and 1 on
// average.
NormalEquations MetricEquations(const std::vector<Motion>& motions) {
  const auto weight = static_cast<double>(motions.size());
  NormalEquations out(6);
  for (std::size_t i = 0; i < 6; ++i) out.Diagonal(i) = 1e-12 * weight;
  Row6 mean{};
  for (const Motion& m : motions) {
    const Row6 first = QuadraticRow(m.rows[0], m.rows[0]);
    const Row6 second = QuadraticRow(m.rows[1], m.rows[1]);
    Row6 both = QuadraticRow(m.rows[0], m.rows[1]);
    Row6 difference{};
    for (std::size_t i = 0; i < 6; ++i) {
      mean[i] += (first[i] + second[i]) / (2 * weight) * std::sqrt(weight);
      difference[i] = first[i] - second[i];
      both[i] *= 2;
    }
    out.Add(difference, 0);
    out.Add(both, 0);
  }
  out.Add(mean, std::sqrt(weight));
  return out;
}

// A 3 x 3 map after which the two rows of each motion are as long as each other and orthogonal, as
// well as that goes: A of M -> M A. Row k holds column k of A.
std::array<Point, 3> MetricUpgrade(const std::vector<Motion>& motions) {
  const std::vector<double> q = SolutionOf(MetricEquations(motions));
  const auto parts =
      SymmetricEigenpairs(std::array{q[0], q[1], q[2], q[1], q[3], q[4], q[2], q[4], q[5]});
  std::array<Point, 3> out{};
  if (!parts) return out;
  const double least = 1e-4 * std::max(parts->values[2], 1e-300);
  for (std::size_t k = 0; k < 3; ++k) {
    const double* const v = &parts->vectors[3 * k];
    out[k] = std::sqrt(std::max(parts->values[k], least)) * Point{v[0], v[1], v[2]};
  }
  return out;
}

// The scaled rotation nearest to two rows: (M M^T)^(-1/2) M.
WeakPerspective NearestCamera(const Motion& m) {
  const double cross = Dot(m.rows[0], m.rows[1]);
  // Of a symmetric 2 x 2 matrix a: a^(1/2) = (a + d) / t with d^2 = |a|, t = tr a^(1/2).
  const double xx = Dot(m.rows[0], m.rows[0]);
  const double yy = Dot(m.rows[1], m.rows[1]);
  const double d = std::sqrt(std::max(xx * yy - cross * cross, 1e-24));
  const double trace = std::sqrt(xx + yy + 2 * d);
  const double inverse[2][2] = {{(yy + d) / (d * trace), -cross / (d * trace)},
                                {-cross / (d * trace), (xx + d) / (d * trace)}};
  Point rows[2];
  for (int r = 0; r < 2; ++r) rows[r] = inverse[r][0] * m.rows[0] + inverse[r][1] * m.rows[1];
  const Point x = Unit(rows[0]), z = Unit(Cross(x, rows[1])), y = Cross(z, x);
  WeakPerspective out;
  out.scale = 0.5 * trace;
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
  const std::array<Point, 3> a = MetricUpgrade(affine.motions);
  RigidMotion out;
  std::vector<Motion> motions;
  for (const Motion& m : affine.motions) {
    Motion upgraded{{}, m.shift};
    for (std::size_t r = 0; r < 2; ++r) {
      upgraded.rows[r] = {Dot(a[0], m.rows[r]), Dot(a[1], m.rows[r]), Dot(a[2], m.rows[r])};
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

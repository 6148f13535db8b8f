// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/factorization.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "train/dense.h"
#include "train/points3.h"

namespace tilegrad::train {
namespace {

using points3::Cross, points3::Dot, points3::Point, points3::Unit, points3::operator+,
    points3::operator-, points3::operator*;
using Views = std::vector<std::vector<Keypoint>>;  // [view][keypoint]

constexpr int kStarts = 6;
constexpr std::size_t kFewestViews = 8, kFewestKeypoints = 4;
constexpr int kAffineRounds = 60, kRigidRounds = 40;
constexpr double kRidge = 1e-3;  // of motions, relative to a view's weight

// Before shapes are turned to an object's axes.
struct RigidMotion {
  std::vector<WeakPerspective> cameras;  // of the views
  std::vector<Point> shape;
  double squares = 0;  // of the residuals
};

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

// Fits one view: [S 1] -> x and y by least squares.
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

// Fits one keypoint over all views that see it; it stays if none does.
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
    for (std::size_t r = 0; r < 2; ++r)
      upgraded.rows[r] = {Dot(a[0], m.rows[r]), Dot(a[1], m.rows[r]), Dot(a[2], m.rows[r])};
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

// Alternates least squares for each view's rows and shift and for the points, from a random start;
// then finds the map that makes each view's rows orthogonal and of equal length; then alternates
// cameras and points. Views should have about unit extent.
RigidMotion FindRigidMotion(const Views& views, std::uint64_t seed) {
  return MakeRigid(Alternate(views, seed), views);
}

// How much nearer visible keypoints are than hidden ones, summed over the views.
double Nearer(const RigidMotion& rigid, const Views& views) {
  double sum = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    double depth[2] = {}, count[2] = {};
    for (std::size_t k = 0; k < rigid.shape.size(); ++k) {
      depth[views[v][k].visible] += ProjectWeakly(rigid.cameras[v], rigid.shape[k])[2];
      count[views[v][k].visible] += 1;
    }
    if (count[0] > 0 && count[1] > 0) sum += depth[0] / count[0] - depth[1] / count[1];
  }
  return sum;
}

// The same pictures of the shape with its depth turned around.
void TurnDepthAround(RigidMotion* rigid) {
  for (Point& p : rigid->shape) p[2] = -p[2];
  for (WeakPerspective& c : rigid->cameras) {
    const auto& [w, x, y, z] = c.quaternion;
    c.quaternion = {w, -x, -y, z};
  }
}

Point MeanDirection(const std::vector<Point>& shape,
                    const std::vector<std::pair<int, int>>& pairs) {
  Point sum = {};
  for (const auto& [from, to] : pairs)
    sum = sum + Unit(shape[static_cast<std::size_t>(to)] - shape[static_cast<std::size_t>(from)]);
  return sum;
}

// Without names for up and front: along the longest way through the shape across x.
Point LongestAcross(const std::vector<Point>& shape, const Point& x) {
  Point best = {}, mean = {};
  for (const Point& p : shape) mean = mean + (1.0 / static_cast<double>(shape.size())) * p;
  for (const Point& p : shape) {
    const Point across = (p - mean) - Dot(p - mean, x) * x;
    if (Dot(across, across) > Dot(best, best)) best = across;
  }
  return best;
}

// Rows: the object's axes in the shape's coordinates, right-handed. The front counts before what is
// up: it is farther away.
std::array<Point, 3> Axes(const std::vector<Point>& shape, const KeypointViews& job) {
  const Point x = Unit(MeanDirection(shape, job.left));
  const auto across = [&](const Point& d) { return Unit(d - Dot(d, x) * x); };
  if (job.front.empty() && !job.up.empty()) {
    const Point y = across(MeanDirection(shape, job.up));
    return {x, y, Cross(x, y)};
  }
  const Point z =
      across(job.front.empty() ? LongestAcross(shape, x) : MeanDirection(shape, job.front));
  return {x, Cross(z, x), z};
}

// Left, up and front together say which of the two shapes it is; else what hides what does.
bool IsTurnedAround(const RigidMotion& rigid, const KeypointViews& job, const Views& views) {
  if (job.up.empty() || job.front.empty()) return Nearer(rigid, views) < 0;
  return Dot(Axes(rigid.shape, job)[1], MeanDirection(rigid.shape, job.up)) < 0;
}

double LargestDistance(const std::vector<Point>& shape) {
  double largest = 0;
  for (const Point& a : shape)
    for (const Point& b : shape) largest = std::max(largest, Dot(a - b, a - b));
  return std::sqrt(largest);
}

// To the object's axes, symmetric at x = 0, of largest distance 2. Cameras are to be fitted again.
void Align(const KeypointViews& job, RigidMotion* rigid) {
  const std::array<Point, 3> axes = Axes(rigid->shape, job);
  std::vector<Point> turned, shape;
  Point centre = {};
  for (const Point& p : rigid->shape)
    turned.push_back({Dot(axes[0], p), Dot(axes[1], p), Dot(axes[2], p)});
  for (const Point& p : turned) centre = centre + (1.0 / static_cast<double>(turned.size())) * p;
  for (std::size_t k = 0; k < turned.size(); ++k) {
    const Point p = turned[k] - centre;
    const Point m = turned[static_cast<std::size_t>(job.mirror[k])] - centre;
    shape.push_back({0.5 * (p[0] - m[0]), 0.5 * (p[1] + m[1]), 0.5 * (p[2] + m[2])});
  }
  const double factor = 2 / std::max(LargestDistance(shape), 1e-12);
  for (Point& p : shape) p = factor * p;
  for (WeakPerspective& camera : rigid->cameras) {
    const Mat3Array r = RotationOf(camera.quaternion);
    Mat3Array product;
    Point at = {};  // where the new origin is seen
    for (std::size_t c = 0; c < 3; ++c) at = at + centre[c] * axes[c];
    const Point seen = ProjectWeakly(camera, at);
    for (std::size_t i = 0; i < 9; ++i)
      product[i] = Dot({r[i / 3 * 3], r[i / 3 * 3 + 1], r[i / 3 * 3 + 2]}, axes[i % 3]);
    camera = {camera.scale / factor, {seen[0], seen[1]}, QuaternionOf(product)};
  }
  rigid->shape = std::move(shape);
}

// Keypoints about their mean in units of the view's extent, so that all views have equal weight.
struct Normalization {
  double x = 0, y = 0, extent = 1;
};

Normalization NormalizationOf(const std::vector<Keypoint>& view) {
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (const Keypoint& k : view) {
    if (!k.visible) continue;
    low[0] = std::min(low[0], k.x);
    high[0] = std::max(high[0], k.x);
    low[1] = std::min(low[1], k.y);
    high[1] = std::max(high[1], k.y);
  }
  return {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2,
          std::max({high[0] - low[0], high[1] - low[1], 1e-9})};
}

std::vector<Keypoint> Normalized(std::vector<Keypoint> view, const Normalization& n) {
  for (Keypoint& k : view) {
    k.x = (k.x - n.x) / n.extent;
    k.y = (k.y - n.y) / n.extent;
  }
  return view;
}

std::vector<Keypoint> MirroredView(const std::vector<Keypoint>& view,
                                   const std::vector<int>& mirror) {
  std::vector<Keypoint> out;
  for (const int m : mirror) {
    Keypoint k = view[static_cast<std::size_t>(m)];
    k.x = -k.x;
    out.push_back(k);
  }
  return out;
}

Status Check(const KeypointViews& job) {
  if (job.views.size() < kFewestViews)
    return InvalidArgument("cameras from keypoints need at least {} photographs, there are {}",
                           kFewestViews, job.views.size());
  if (job.left.empty())
    return InvalidArgument("cameras from keypoints need a pair of left and right keypoints");
  for (std::size_t v = 0; v < job.views.size(); ++v) {
    const auto visible = std::ranges::count_if(job.views[v], &Keypoint::visible);
    if (job.views[v].size() != job.mirror.size() ||
        visible < static_cast<std::ptrdiff_t>(kFewestKeypoints))
      return InvalidArgument(
          "photograph {}: a camera needs at least {} visible keypoints, there are {}", v,
          kFewestKeypoints, visible);
  }
  return {};
}

}  // namespace

std::vector<Point> LocateKeypoints(const std::vector<std::vector<Keypoint>>& views,
                                   const std::vector<WeakPerspective>& cameras) {
  std::vector<Motion> motions;
  for (const WeakPerspective& camera : cameras) motions.push_back(MotionOf(camera));
  std::vector<Point> out(views.empty() ? 0 : views[0].size());
  for (std::size_t k = 0; k < out.size(); ++k) FitPoint(motions, views, k, &out[k]);
  return out;
}

Result<Structure> FactorizeKeypoints(const KeypointViews& job) {
  TILEGRAD_TRY(Check(job));
  Views views;
  std::vector<Normalization> normals;
  for (const auto& view : job.views) {
    normals.push_back(NormalizationOf(view));
    views.push_back(Normalized(view, normals.back()));
  }
  for (std::size_t v = 0; v < job.views.size(); ++v)
    views.push_back(MirroredView(views[v], job.mirror));
  std::optional<RigidMotion> best;
  for (int start = 0; start < kStarts; ++start) {
    RigidMotion rigid = FindRigidMotion(views, static_cast<std::uint64_t>(start));
    if (!best || rigid.squares < best->squares) best = std::move(rigid);
  }
  if (IsTurnedAround(*best, job, views)) TurnDepthAround(&*best);
  Align(job, &*best);
  Structure out{best->shape, {}, 0};
  double squares = 0;
  for (std::size_t v = 0; v < job.views.size(); ++v) {
    const WeakPerspective camera = FitWeakCamera(out.shape, views[v], best->cameras[v]);
    const double error = WeakCameraError(out.shape, views[v], camera);
    squares += error * error;
    const Normalization& n = normals[v];
    out.cameras.push_back(
        {camera.scale * n.extent,
         {camera.translation[0] * n.extent + n.x, camera.translation[1] * n.extent + n.y},
         camera.quaternion});
  }
  out.error = std::sqrt(squares / static_cast<double>(job.views.size()));
  return out;
}

}  // namespace tilegrad::train

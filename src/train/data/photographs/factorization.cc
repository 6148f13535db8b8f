// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/factorization.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/small_systems.h"

namespace tilegrad::train {
namespace {

using Point = std::array<double, 3>;
using Views = std::vector<std::vector<Keypoint>>;

constexpr int kStarts = 6, kAffineRounds = 60, kRigidRounds = 40;
constexpr double kRidge = 1e-3;  // of motions, in parts of a view's weight
constexpr std::size_t kFewestViews = 8, kFewestKeypoints = 4;

Point operator+(const Point& a, const Point& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Point operator-(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Point operator*(double s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }
double Dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point Cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point Unit(const Point& a) { return (1 / std::sqrt(std::max(Dot(a, a), 1e-300))) * a; }

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

struct Rigid {
  std::vector<WeakPerspective> cameras;
  std::vector<Point> shape;
  double squares = 0;
};

Rigid MakeRigid(const Affine& affine, const Views& views) {
  const Matrix<3> a = MetricUpgrade(affine.motions);
  Rigid out;
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

// How much nearer visible keypoints are than hidden ones, summed over the views.
double Nearer(const Rigid& rigid, const Views& views) {
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
void TurnDepthAround(Rigid* rigid) {
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

// Rows: the object's axes in the shape's coordinates, right-handed.
std::array<Point, 3> Axes(const std::vector<Point>& shape, const KeypointViews& job) {
  const Point x = Unit(MeanDirection(shape, job.left));
  const auto across = [&](const Point& d) { return Unit(d - Dot(d, x) * x); };
  if (!job.up.empty()) {
    const Point y = across(MeanDirection(shape, job.up));
    return {x, y, Cross(x, y)};
  }
  const Point z =
      across(job.front.empty() ? LongestAcross(shape, x) : MeanDirection(shape, job.front));
  return {x, Cross(z, x), z};
}

// Left, up and front together say which of the two shapes it is; else what hides what does.
bool IsTurnedAround(const Rigid& rigid, const KeypointViews& job, const Views& views) {
  if (job.up.empty() || job.front.empty()) return Nearer(rigid, views) < 0;
  return Dot(Axes(rigid.shape, job)[2], MeanDirection(rigid.shape, job.front)) < 0;
}

double LargestDistance(const std::vector<Point>& shape) {
  double largest = 0;
  for (const Point& a : shape)
    for (const Point& b : shape) largest = std::max(largest, Dot(a - b, a - b));
  return std::sqrt(largest);
}

// To the object's axes, symmetric at x = 0, of largest distance 2. Cameras are to be fitted again.
void Align(const KeypointViews& job, Rigid* rigid) {
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

// Keypoints about their mean in parts of the view's extent, so that all views count the same.
struct Normal {
  double x = 0, y = 0, extent = 1;
};

Normal NormalOf(const std::vector<Keypoint>& view) {
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (const Keypoint& k : view) {
    if (!k.visible) continue;
    low[0] = std::min(low[0], k.x), high[0] = std::max(high[0], k.x);
    low[1] = std::min(low[1], k.y), high[1] = std::max(high[1], k.y);
  }
  return {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2,
          std::max({high[0] - low[0], high[1] - low[1], 1e-9})};
}

std::vector<Keypoint> Normalized(std::vector<Keypoint> view, const Normal& n) {
  for (Keypoint& k : view) k.x = (k.x - n.x) / n.extent, k.y = (k.y - n.y) / n.extent;
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
          "photograph {}: a camera needs at least {} visible keypoints, there "
          "are {}",
          v, kFewestKeypoints, visible);
  }
  return {};
}

}  // namespace

std::vector<Point> LocateKeypoints(const Views& views,
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
  std::vector<Normal> normals;
  for (const auto& view : job.views) {
    normals.push_back(NormalOf(view));
    views.push_back(Normalized(view, normals.back()));
  }
  for (std::size_t v = 0; v < job.views.size(); ++v)
    views.push_back(MirroredView(views[v], job.mirror));
  std::optional<Rigid> best;
  for (int start = 0; start < kStarts; ++start) {
    Rigid rigid = MakeRigid(Alternate(views, static_cast<std::uint64_t>(start)), views);
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
    const Normal& n = normals[v];
    out.cameras.push_back(
        {camera.scale * n.extent,
         {camera.translation[0] * n.extent + n.x, camera.translation[1] * n.extent + n.y},
         camera.quaternion});
  }
  out.error = std::sqrt(squares / static_cast<double>(job.views.size()));
  return out;
}

}  // namespace tilegrad::train

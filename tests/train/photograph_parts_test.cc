// SPDX-License-Identifier: Apache-2.0
// Operations, losses and scores of photographs: values by hand, gradients against central
// differences in float64.
#include <gtest/gtest.h>

#include <cmath>

#include "base/rng.h"
#include "gradient_check.h"
#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "scene/weak_perspective_ref.h"
#include "support/shared_data.h"
#include "train/data/photographs/distance_barrier.h"
#include "train/losses/laplacian.h"
#include "train/metrics/metrics.h"
#include "train/models/camera_ops.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train::photograph_parts_test {

using PhotographParts = GradientCheck;

TEST_F(PhotographParts, ProjectionsAndTheirGradients) {
  const nn::Shape points = {2, 5, 3}, cameras = {2, 7};
  const auto p = Uniform(30, -1, 1, 1), c = Uniform(14, 0.2, 1, 2);
  const nn::Var seen = ProjectPoints(Const(points, p), Const(cameras, c));
  const auto want = ProjectWeakly<double>({c[7], {c[8], c[9]}, {c[10], c[11], c[12], c[13]}},
                                          {p[15], p[16], p[17]});
  EXPECT_NEAR(seen.value().span<double>()[10], want[0], 1e-14);
  EXPECT_NEAR(seen.value().span<double>()[11], want[1], 1e-14);
  ExpectGradient([&](const nn::Var& x) { return ProjectPoints(x, Const(cameras, c)); }, points, p);
  ExpectGradient([&](const nn::Var& x) { return ProjectPoints(Const(points, p), x); }, cameras, c);
  const nn::Var wrong = ProjectPoints(Const(points, p), Const({1, 7}, Uniform(7, 0, 1, 3)));
  EXPECT_FALSE(wrong.valid());
  EXPECT_FALSE(context_.TakeStatus().ok());
}

TEST_F(PhotographParts, PinholesAndTheirGradients) {
  const auto c = Uniform(14, 0.2, 1, 2);
  ExpectGradient([&](const nn::Var& x) { return 1e-3 * PinholeCameras(x, 64); }, {2, 7}, c);
  const nn::Var rows = PinholeCameras(Const({2, 7}, c), 64);
  const Camera camera = PinholeIn({c[0], {c[1], c[2]}, {c[3], c[4], c[5], c[6]}}, 64);
  EXPECT_NEAR(rows.value().span<double>()[12], camera.fx, 1e-2);
  EXPECT_NEAR(rows.value().span<double>()[14], camera.cx, 1e-5);
  EXPECT_NEAR(camera.cx, 32 * (c[1] + 1), 1e-5);
}

// The first row keeps its direction, the second its side of it; also where one is long, or where
// the quaternion's w is near 0.
TEST_F(PhotographParts, RowsAreRotationsWithGradients) {
  std::vector<double> rows = {0.3, -0.2, 0.9, 0.5, 2, 0.1};
  for (const double start : {-1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0}) rows.push_back(start);
  const auto noise = Uniform(12, -0.1, 0.1, 4);
  for (std::size_t i = 0; i < 12; ++i) rows[6 + i] += noise[i];
  const nn::Shape shape = {3, 6};
  const nn::Var out = QuaternionsOfRows(Const(shape, rows));
  const auto q = out.value().span<double>();
  for (std::size_t b = 0; b < 3; ++b) {
    const std::array<double, 4> unit = {q[4 * b], q[4 * b + 1], q[4 * b + 2], q[4 * b + 3]};
    EXPECT_NEAR(std::hypot(std::hypot(unit[0], unit[1]), std::hypot(unit[2], unit[3])), 1, 1e-12);
    EXPECT_GE(unit[0], 0);
    const auto matrix = RotationOf(unit);
    const double* row = &rows[6 * b];
    const double length = std::hypot(row[0], row[1], row[2]);
    double across = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(matrix[c], row[c] / length, 1e-12);
      across += matrix[6 + c] * row[3 + c];
    }
    EXPECT_NEAR(across, 0, 1e-12);
    EXPECT_GT(matrix[3] * row[3] + matrix[4] * row[4] + matrix[5] * row[5], 0);
  }
  ExpectGradient([&](const nn::Var& x) { return QuaternionsOfRows(x); }, shape, rows);
}

// No length, and parallel: some rotation, finite gradients.
TEST_F(PhotographParts, RowsOfNoRotationDoNoHarm) {
  const std::vector<double> rows = {0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 3, 1, 0, 0, 0, 0, 0};
  const nn::Var in = nn::Parameter(context_, context_.From({3, 6}, std::span<const double>(rows)));
  const nn::Var out = QuaternionsOfRows(in);
  const nn::Tensor d_rows = nn::Grad(nn::Sum(out, {0, 1}), {in})[0].value();
  for (std::size_t b = 0; b < 3; ++b) {
    double squares = 0;
    for (std::size_t i = 0; i < 4; ++i)
      squares += std::pow(out.value().span<double>()[4 * b + i], 2);
    EXPECT_NEAR(squares, 1, 1e-12);
  }
  for (const double d : d_rows.span<double>()) EXPECT_TRUE(std::isfinite(d));
}

// A picture of 4 x 2 pixels whose values are their columns, and twice their rows.
TEST_F(PhotographParts, PicturesAreSampledBetweenPixelCentres) {
  std::vector<double> pixels;
  for (int channel = 0; channel < 2; ++channel)
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 4; ++x) pixels.push_back(channel == 0 ? x : 2 * y);
  const nn::Tensor picture = context_.From({1, 2, 2, 4}, std::span<const double>(pixels));
  // Centres are at -3/4, -1/4, 1/4, 3/4 and -1/2, 1/2; beyond them the edge goes on.
  const nn::Var seen =
      nn::SamplePictures(picture, Const({1, 2, 1, 4}, {-0.25, 0, 1, -7, 0.5, 0, 0, 9}));
  const double want[] = {1, 1.5, 3, 0, 2, 1, 1, 2};
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(seen.value().span<double>()[i], want[i], 1e-12);
  const nn::Tensor noise =
      context_.From({2, 3, 5, 4}, std::span<const double>(Uniform(120, 0, 1, 5)));
  ExpectGradient([&](const nn::Var& x) { return nn::SamplePictures(noise, x); }, {2, 2, 3, 3},
                 Uniform(36, -0.7, 0.7, 6));
}

// By hand: a right-angled corner with legs of 1 in a plane. The angle at the right corner has
// cotangent 0, the others 1: L of the tip (1, 0, 0) is 1/2 (0, 0, 0) - (1, 0, 0)) + 0.
TEST_F(PhotographParts, CotangentLaplacianOfATriangle) {
  const std::vector<Face> faces = {{0, 1, 2}};
  const std::vector<double> p = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::vector<double> out(9, 0);
  const auto edges = CotangentWeights(faces, p);
  AddLaplacian<double>(edges, p, out);
  const double want[9] = {0.5, 0.5, 0, -0.5, 0, 0, 0, -0.5, 0};
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(out[i], want[i], 1e-15);
  const double loss = CotangentLaplacianLoss(Const({1, 3, 3}, p), edges).item();
  EXPECT_NEAR(loss, (std::sqrt(0.5) + 0.5 + 0.5) / 3, 1e-15);
}

// A flat fan has none in its middle, however it is cut up: cotangent weights see no tangent.
TEST_F(PhotographParts, CotangentLaplacianOfAFlatFanIsNone) {
  std::vector<double> p = {0.1, -0.05, 0};
  std::vector<Face> faces;
  for (int i = 0; i < 7; ++i) {
    const double angle = 0.8 * i + 0.1 * (i % 3);
    p.insert(p.end(), {std::cos(angle), std::sin(angle), 0});
    faces.push_back({0, 1 + i, 1 + (i + 1) % 7});
  }
  std::vector<double> out(p.size(), 0);
  AddLaplacian<double>(CotangentWeights(faces, p), p, out);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(out[c], 0, 1e-14);
}

TEST_F(PhotographParts, CotangentLaplacianGradient) {
  const Mesh mesh = Icosphere(1, 1);
  std::vector<double> p = Uniform(6 * mesh.positions.size(), -0.1, 0.1, 7), sphere;
  for (const glm::vec3& v : mesh.positions) sphere.insert(sphere.end(), {v.x, v.y, v.z});
  for (std::size_t i = 0; i < p.size(); ++i) p[i] += sphere[i % sphere.size()];
  const auto edges = CotangentWeights(mesh.faces, sphere);
  ExpectGradient([&](const nn::Var& x) { return CotangentLaplacianLoss(x, edges); },
                 {2, static_cast<std::int64_t>(mesh.positions.size()), 3}, p);
}

TEST_F(PhotographParts, SliversStayFinite) {
  const std::vector<Face> faces = {{0, 1, 2}};
  for (const WeighedEdge& edge :
       CotangentWeights(faces, std::vector<double>{0, 0, 0, 1, 0, 0, 2, 0, 0}))
    EXPECT_LE(std::abs(edge.weight), kMostCotangent / 2);
}

// By hand. Keypoint 0 is right in one of two pictures, keypoint 1 in its only one, keypoint 2 is
// never seen: the mean of 1/2 and 1.
TEST(KeypointScores, AreMeansOverKeypoints) {
  KeypointScore score(3, 0.1);
  EXPECT_FALSE(score.Mean());
  score.Add(0, 0.05);
  score.Add(0, 0.1);
  score.Add(1, 0.0);
  EXPECT_EQ(score.Mean(), 0.75);
}

TEST(DistanceBarriers, DistancesAreEuclidean) {
  std::vector<float> mask(49, 0.0f);
  mask[3 * 7 + 2] = 1;
  mask[0] = 1;
  const auto squares = SquaredDistances(mask, 7, true);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 7; ++x) {
      const int want = std::min(x * x + y * y, (x - 2) * (x - 2) + (y - 3) * (y - 3));
      EXPECT_EQ(squares[static_cast<std::size_t>(y * 7 + x)], want) << x << " " << y;
    }
  }
}

TEST(DistanceBarriers, AreAboutNothingInsideAndOneOutside) {
  std::vector<float> mask(32 * 32, 0.0f), barrier(32 * 32);
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = i % 32 < 16 ? 1.0f : 0.0f;
  DistanceBarrier(mask, 32, barrier);
  EXPECT_LT(barrier[5 * 32 + 2], 1e-6f);
  EXPECT_GT(barrier[5 * 32 + 29], 1 - 1e-6f);
  EXPECT_NEAR(barrier[5 * 32 + 15], 1 / (1 + std::exp(50.0 / 32)), 1e-6);
  EXPECT_NEAR(barrier[5 * 32 + 16], 1 / (1 + std::exp(-50.0 / 32)), 1e-6);
  std::fill(mask.begin(), mask.end(), 1.0f);  // nothing outside: still finite
  DistanceBarrier(mask, 32, barrier);
  EXPECT_EQ(barrier[0], 0.0f);
}

// N3MR's vertex parameterisation: values worked out by hand, independent numbers, differences.

using Vector = std::vector<double>;

struct Setting {
  nn::Context& context;
  nn::Var bias, centroid;
  nn::Tensor sphere;

  Setting(nn::Context& c, std::int64_t batch, const Vector& s, const Vector& b, const Vector& m)
      : context(c),
        bias(nn::Parameter(c, c.From({batch, Vertices(s), 3}, std::span<const double>(b)))),
        centroid(nn::Parameter(c, c.From({batch, 1, 3}, std::span<const double>(m)))),
        sphere(c.From({Vertices(s), 3}, std::span<const double>(s))) {}
  static std::int64_t Vertices(const Vector& s) { return static_cast<std::int64_t>(s.size() / 3); }
  nn::Var Out() const { return SphereVertices(bias, centroid, sphere); }
};

void ExpectNear(const nn::Var& got, const Vector& want, double tolerance) {
  nn::Tensor value = got.value();
  ASSERT_EQ(value.elements(), want.size());
  for (std::size_t i = 0; i < want.size(); ++i)
    EXPECT_NEAR(value.span<double>()[i], want[i], tolerance) << i;
}

// Without bias and centroid a quarter of the sphere; far biases reach the cube's side and middle; a
// centroid at the side takes both halves there; a coordinate of 0 stays at the centroid.
TEST(SphereVertices, ValuesByHand) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {0, 0, 0}, {0, 0, 0}).Out(), {0.15, -0.2, 0},
             1e-15);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {40, -40, 40}, {0, 0, 0}).Out(), {0.5, 0, 0},
             1e-15);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {0, 0, 0}, {400, 400, 400}).Out(),
             {0.5, 0.5 - 0.4, 0.5}, 1e-15);
}

// 1e-12: both sides compute in double, on numbers near 1.
TEST(SphereVertices, GivesTheIndependentNumbers) {
  TILEGRAD_VECTORS_OR_SKIP(file, "11_n3mr_vertex_parameterisation.json");
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Setting at(context, 2, tilegrad::Numbers(file["template"]),
                   tilegrad::Numbers(file["bias_out"]), tilegrad::Numbers(file["centroid_out"]));
  const nn::Var out = at.Out();
  ExpectNear(out, tilegrad::Numbers(file["vertices"]), 1e-12);
  const Vector push = tilegrad::Numbers(file["grad_out"]);
  const nn::Var d = nn::Constant(context, context.From(out.shape(), std::span<const double>(push)));
  const auto gradients = nn::Grad(nn::Sum(out * d), {at.bias, at.centroid});
  ExpectNear(gradients[0], tilegrad::Numbers(file["grad_bias"]), 1e-12);
  ExpectNear(gradients[1], tilegrad::Numbers(file["grad_centroid"]), 1e-12);
}

TEST(SphereVertices, GradientsAreDerivatives) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Vector sphere = Uniform(12, -1, 1, 4);
  Setting at(context, 2, sphere, Uniform(24, -1, 1, 5), Uniform(6, -1, 1, 6));
  const auto loss = [&] {
    const nn::Var out = at.Out();
    return nn::Sum(out * out * out + out);
  };
  Rng rng(7);
  nn::ExpectGradientBy({at.bias, at.centroid}, loss, rng);
}

}  // namespace tilegrad::train::photograph_parts_test

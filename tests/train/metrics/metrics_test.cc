// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "base/rng.h"
#include "support/temp_folder.h"
#include "train/metrics/face_tree.h"
#include "train/metrics/set_scores.h"

namespace tilegrad::train::metrics_test {

using Points = std::vector<glm::vec3>;

Points Cloud(int count, std::uint64_t seed) {
  Rng rng(seed);
  Points points;
  for (int i = 0; i < count; ++i) {
    glm::vec3 p;
    for (int k = 0; k < 3; ++k) p[k] = static_cast<float>(rng.Uniform(-0.45, 0.45));
    points.push_back(p);
  }
  return points;
}

double NearestByAllPairs(const glm::vec3& from, const Points& to) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& p : to) best = std::min(best, glm::distance(glm::dvec3(from), glm::dvec3(p)));
  return best;
}

TEST(VoxelIou, CountsVoxels) {
  const std::vector<std::uint8_t> a = {1, 1, 0, 0, 1}, b = {1, 0, 0, 1, 1}, none(5, 0);
  EXPECT_DOUBLE_EQ(VoxelIou(a, b), 2.0 / 4.0);
  EXPECT_DOUBLE_EQ(VoxelIou(a, a), 1.0);
  EXPECT_DOUBLE_EQ(VoxelIou(a, none), 0.0);
  EXPECT_DOUBLE_EQ(VoxelIou(none, none), 1.0);
}

TEST(CompareSurfaces, AgreesWithAllPairs) {
  for (const int count : {1, 2, 3, 17, 400}) {
    const Points a = Cloud(count, 2), b = Cloud(300, 3);
    double chamfer = 0, precision = 0, recall = 0;
    for (const auto& p : a) {
      const double d = NearestByAllPairs(p, b);
      chamfer += 0.5 * d / static_cast<double>(a.size());
      precision += d <= 0.05;
    }
    for (const auto& p : b) {
      const double d = NearestByAllPairs(p, a);
      chamfer += 0.5 * d / static_cast<double>(b.size());
      recall += d <= 0.05;
    }
    const SurfaceScore score = CompareSurfaces(a, b, 0.05);
    EXPECT_NEAR(score.chamfer, chamfer, 1e-13);  // sums of 400 terms below 1 in double
    EXPECT_DOUBLE_EQ(score.precision, precision / static_cast<double>(a.size()));
    EXPECT_DOUBLE_EQ(score.recall, recall / static_cast<double>(b.size()));
  }
}

TEST(CompareSurfaces, EqualPointsAndPointsInALine) {
  const Points same(100, glm::vec3(0.25f)), one = {glm::vec3(0.25f, 0.25f, 0.75f)};
  const SurfaceScore score = CompareSurfaces(same, one, 0.6);
  EXPECT_DOUBLE_EQ(score.chamfer, 0.5);
  EXPECT_EQ(score.f_score, 1);
  EXPECT_EQ(CompareSurfaces(same, one, 0.5).f_score, 1);  // the threshold itself counts
  EXPECT_EQ(CompareSurfaces(same, one, 0.499).f_score, 0);
}

TEST(CompareSurfaces, PrecisionIsOfThePrediction) {
  const Points truth = {{0, 0, 0}, {1, 0, 0}}, predicted = {{0, 0, 0}};
  const SurfaceScore score = CompareSurfaces(predicted, truth, 0.1);
  EXPECT_DOUBLE_EQ(score.precision, 1.0);
  EXPECT_DOUBLE_EQ(score.recall, 0.5);
  EXPECT_DOUBLE_EQ(score.f_score, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.chamfer, 0.25);  // (0 + (0 + 1) / 2) / 2
}

TEST(CompareSurfaces, NothingScoresZero) {
  const Points some = Cloud(3, 4);
  EXPECT_EQ(CompareSurfaces({}, some, 0.1).f_score, 0);
  EXPECT_EQ(CompareSurfaces(some, {}, 0.1).f_score, 0);
}

TEST(NearestPoint, IsTheFirstOfTheNearest) {
  Points points = Cloud(300, 5);
  points.insert(points.end(), points.begin(), points.begin() + 50);  // later ones of equal distance
  const NearestPoint tree{std::span<const glm::vec3>(points)};
  for (const glm::vec3& query : Cloud(100, 6)) {
    std::size_t best = 0;
    const auto distance = [&](std::size_t i) {
      return glm::distance(glm::dvec3(query), glm::dvec3(points[i]));
    };
    for (std::size_t i = 1; i < points.size(); ++i) best = distance(i) < distance(best) ? i : best;
    const auto found = tree.Find(glm::dvec3(query));
    EXPECT_EQ(found.index, static_cast<std::int32_t>(best));
    EXPECT_DOUBLE_EQ(std::sqrt(found.squared), distance(best));
  }
  EXPECT_EQ(NearestPoint(std::span<const glm::vec3>()).Find({0, 0, 0}).index, -1);
}

TEST(SampleFaces, FollowsTheAreas) {
  const std::vector<double> areas = {1, 0, 3};
  std::array<int, 3> count{};
  glm::dvec3 mean(0);
  const auto samples = SampleFaces(areas, 4000, 7).value();
  for (const SurfaceSample& s : samples) {
    ++count[static_cast<std::size_t>(s.face)];
    mean += glm::dvec3(s.weights[0], s.weights[1], s.weights[2]) / 4000.0;
    EXPECT_NEAR(s.weights[0] + s.weights[1] + s.weights[2], 1, 1e-15);
  }
  EXPECT_EQ(count[1], 0);
  EXPECT_NEAR(count[0], 1000, 5 * std::sqrt(4000 * 0.25 * 0.75));  // five standard deviations
  // Each weight has the variance 1/18 in a triangle.
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(mean[k], 1.0 / 3, 5 * std::sqrt(1.0 / 18 / 4000));
  EXPECT_FALSE(SampleFaces(std::vector<double>{0, 0}, 1, 7).ok());
  EXPECT_FALSE(SampleFaces(areas, -1, 7).ok());
}

// Distances of sets against values by hand and in closed form.

// Rows at +-s along each of two axes turned by `angle`, moved by m: the mean is m, the unbiased
// covariance has the eigenvalues 2 s^2 / 3 along them.
FeatureRows Cross(double s1, double s2, double angle, double m1, double m2) {
  const double c = std::cos(angle), s = std::sin(angle);
  FeatureRows out{{}, 2};
  for (const auto& [a, b] : {std::pair(s1, 0.0), {-s1, 0.0}, {0.0, s2}, {0.0, -s2}}) {
    out.values.push_back(static_cast<float>(c * a - s * b + m1));
    out.values.push_back(static_cast<float>(s * a + c * b + m2));
  }
  return out;
}

FeatureRows Normals(std::size_t rows, std::size_t width, double shift, std::uint64_t seed) {
  Rng rng(seed);
  FeatureRows out{{}, width};
  for (std::size_t i = 0; i < rows * width; ++i)
    out.values.push_back(static_cast<float>(rng.Normal() + shift));
  return out;
}

FeatureRows Column(std::vector<float> values) { return {std::move(values), 1}; }

class SetScoresTest : public testing::Test {
 protected:
  Workers workers_{2};
};

// Of commuting covariances: |m|^2 + sum of squared differences of deviations.
TEST_F(SetScoresTest, FrechetOfAlignedNormals) {
  const double unit = std::sqrt(2.0 / 3);
  const auto d = Ok(FrechetDistance(Cross(1, 3, 0, 0, 0), Cross(2, 5, 0, 3, -4)));
  EXPECT_NEAR(*d, 25 + unit * unit * (1 + 4), 1e-6 * 50);
  EXPECT_NEAR(*FrechetDistance(Cross(1, 3, 0.3, 1, 1), Cross(1, 3, 0.3, 1, 1)), 0, 1e-6);
}

// tr (A B)^(1/2) of 2x2 matrices is sqrt(tr A B + 2 sqrt(det A B)).
TEST_F(SetScoresTest, FrechetOfTurnedNormals) {
  const double a1 = 2.0 / 3 * 1, a2 = 2.0 / 3 * 9, b1 = 2.0 / 3 * 4, b2 = 2.0 / 3 * 25, turn = 0.6;
  const double c2 = std::pow(std::cos(turn), 2), s2 = 1 - c2;
  const double trace = a1 * (b1 * c2 + b2 * s2) + a2 * (b1 * s2 + b2 * c2);
  const double root = std::sqrt(trace + 2 * std::sqrt(a1 * a2 * b1 * b2));
  const auto d = Ok(FrechetDistance(Cross(1, 3, 0, 0, 0), Cross(2, 5, turn, 0, 0)));
  EXPECT_NEAR(*d, a1 + a2 + b1 + b2 - 2 * root, 1e-5);
}

// More columns than rows: covariances without full rank.
TEST_F(SetScoresTest, FrechetOfFewRowsIsFinite) {
  const FeatureRows a = Normals(5, 40, 0, 1);
  EXPECT_NEAR(*FrechetDistance(a, a), 0, 1e-4);
  EXPECT_GT(*FrechetDistance(a, Normals(5, 40, 1, 2)), 20);
}

// k = (x y + 1)^3 of {0, 1} and {2, 3}: 1 + 343 - 2 (1 + 1 + 27 + 64) / 4.
TEST_F(SetScoresTest, KernelDistanceByHand) {
  const FeatureRows a = Column({0, 1}), b = Column({2, 3});
  EXPECT_NEAR(*KernelDistance(a, b, workers_), 1 + 343 - 46.5, 1e-9);
}

TEST_F(SetScoresTest, KernelDistanceOfOneDistributionScattersAroundZero) {
  double sum = 0;
  for (std::uint64_t i = 0; i < 8; ++i)
    sum += *KernelDistance(Normals(60, 4, 0, 2 * i), Normals(60, 4, 0, 2 * i + 1), workers_);
  const double apart = *KernelDistance(Normals(60, 4, 0, 50), Normals(60, 4, 1, 51), workers_);
  EXPECT_LT(std::abs(sum / 8), 0.05 * apart);
}

// Radii (k = 1) are 1 among the truth, 0.1 and 1 among what is generated.
TEST_F(SetScoresTest, PrecisionAndRecallByHand) {
  const FeatureRows truth = Column({0, 1, 10, 11}), generated = Column({0.5f, 0.4f, 100, 101});
  const auto coverage = Ok(PrecisionRecall(truth, generated, workers_, 1));
  EXPECT_EQ(coverage->precision, 0.5);
  EXPECT_EQ(coverage->recall, 0);
  const auto narrow = PrecisionRecall(truth, Column({0, 0.5f, 1, 1.5f}), workers_, 1);
  EXPECT_EQ(narrow->precision, 1);
  EXPECT_EQ(narrow->recall, 0.5);
  // k = 3: every radius of the truth reaches the other pair.
  EXPECT_EQ(PrecisionRecall(truth, Column({5, 5, 5, 5}), workers_)->precision, 1);
  EXPECT_EQ(PrecisionRecall(truth, Column({5, 5, 5, 5}), workers_)->recall, 0);
  ExpectMessage(PrecisionRecall(truth, Column({5, 5, 5}), workers_).status(), "3 rows", "4");
}

TEST_F(SetScoresTest, NearestIsTheFirstOfEquals) {
  const auto nearest = Ok(NearestRows({{0, 0, 4, 3}, 2}, {{5, 0, 0, 2, 2, 0}, 2}, workers_));
  EXPECT_EQ((*nearest)[0].row, 1u);
  EXPECT_EQ((*nearest)[0].distance, 2);
  EXPECT_EQ((*nearest)[1].row, 0u);
  EXPECT_NEAR((*nearest)[1].distance, std::sqrt(10.0), 1e-12);
}

TEST_F(SetScoresTest, CopiesAreNoticed) {
  const FeatureRows train = Normals(50, 3, 0, 1), held_out = Normals(20, 3, 0, 2);
  const auto copies = Ok(MeasureMemorisation(SliceRows(train, 5, 25), held_out, train, workers_));
  EXPECT_EQ(copies->sample_median, 0);
  EXPECT_GT(copies->held_out_median, 0);
  EXPECT_EQ(copies->nearer, 1);
  EXPECT_EQ(copies->samples[3].row, 8u);
  EXPECT_EQ(MeasureMemorisation(held_out, held_out, train, workers_)->nearer, 0.5);
  const auto far = MeasureMemorisation(Normals(20, 3, 9, 3), held_out, train, workers_);
  EXPECT_EQ(far->nearer, 0);
}

// Medians of an even number of distances, and ties that count half: 1, 2 | 2, 3.
TEST_F(SetScoresTest, MedianAndTiesByHand) {
  const auto m = MeasureMemorisation(Column({1, -2}), Column({2, 3}), Column({0}), workers_);
  EXPECT_EQ(m->sample_median, 1.5);
  EXPECT_EQ(m->held_out_median, 2.5);
  EXPECT_EQ(m->nearer, (2 + 1.5) / 4);
}

TEST_F(SetScoresTest, StandardisedByTheReference) {
  const FeatureRows reference{{1, 5, 3, 5}, 2};
  const FeatureRows out = Standardised({{4, 9, 2, 5}, 2}, reference);
  EXPECT_EQ(out.values, (std::vector<float>{2, 0, 0, 0}));
}

TEST_F(SetScoresTest, DrawnRowsAreDistinct) {
  const FeatureRows drawn = DrawRows(Column({0, 1, 2, 3, 4, 5}), 4, 9);
  std::vector<float> sorted = drawn.values;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(sorted.size(), 4u);
  EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end());
  EXPECT_EQ(DrawRows(Column({0, 1}), 5, 1).rows(), 2u);
}

// Both sides have the same number of rows, and the floor is what equal distributions get.
TEST_F(SetScoresTest, FloorStandsBesideTheScore) {
  const FeatureRows truth = Normals(101, 3, 0, 1);
  const auto same = Ok(ScoreSets(truth, Normals(400, 3, 0, 2), 7, workers_));
  EXPECT_EQ(same->n, 50u);
  EXPECT_LT(same->generated.frechet, 3 * same->floor.frechet);
  EXPECT_GT(same->floor.coverage.precision, 0.7);
  const auto apart = ScoreSets(truth, Normals(30, 3, 2, 2), 7, workers_);
  EXPECT_EQ(apart->n, 30u);
  EXPECT_GT(apart->generated.frechet, 10 * apart->floor.frechet);
  EXPECT_GT(apart->generated.kernel, 10 * std::abs(apart->floor.kernel));
  EXPECT_LT(apart->generated.coverage.recall, 0.5 * apart->floor.coverage.recall);
}

TEST_F(SetScoresTest, SameBitsForAnyNumberOfWorkers) {
  const FeatureRows truth = Normals(60, 5, 0, 1), generated = Normals(40, 5, 0.3, 2);
  const auto one = ScoreSets(truth, generated, 1, Workers(1));
  const auto seven = ScoreSets(truth, generated, 1, Workers(7));
  EXPECT_EQ(one->generated.frechet, seven->generated.frechet);
  EXPECT_EQ(one->generated.kernel, seven->generated.kernel);
  EXPECT_EQ(one->generated.coverage.precision, seven->generated.coverage.precision);
}

TEST_F(SetScoresTest, WhatDoesNotFitIsAnError) {
  const FeatureRows good = Normals(9, 2, 0, 1);
  ExpectMessage(FrechetDistance(good, Normals(9, 3, 0, 1)).status(), "2 columns", "3");
  ExpectMessage(FrechetDistance({{1, 2}, 2}, good).status(), "1 rows");
  ExpectMessage(KernelDistance({{1, 2, 3}, 2}, good, workers_).status(), "3 values");
  FeatureRows broken = good;
  broken.values[5] = std::numeric_limits<float>::infinity();
  ExpectMessage(NearestRows(good, broken, workers_).status(), "row 2, column 1");
  ExpectMessage(ScoreSets(Normals(7, 2, 0, 1), good, 1, workers_).status(), "truth", "7 rows");
}

double Energy(const std::vector<float>& values, int channels, int height, int width,
              const std::vector<std::uint8_t>& covered = {}) {
  return Ok(HighPassEnergy({values, channels, height, width}, covered)).value();
}

TEST(HighPass, ConstantAndSlopeHaveNone) {
  EXPECT_EQ(Energy(std::vector<float>(2 * 20, 0.7f), 2, 4, 5), 0);
  std::vector<float> slope;
  for (int i = 0; i < 25; ++i) slope.push_back(static_cast<float>(i % 5) + 2 * (i / 5));
  EXPECT_NEAR(Energy(slope, 1, 5, 5), 0, 1e-12);
}

// The filter takes a chequerboard out entirely: what is left is the picture itself.
TEST(HighPass, ChequerboardKeepsAll) {
  std::vector<float> board;
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 7; ++x) board.push_back((x + y) % 2 == 0 ? 0.25f : -0.25f);
  }
  EXPECT_NEAR(Energy(board, 1, 6, 7), 0.0625, 1e-12);
}

// One bright pixel: 1 - 4/16 there, -2/16 at its four sides and -1/16 at its four corners.
TEST(HighPass, OnePixelByHand) {
  std::vector<float> image(49, 0.0f);
  image[24] = 1;
  EXPECT_NEAR(Energy(image, 1, 7, 7), (144.0 + 4 * 4 + 4 * 1) / 256 / 25, 1e-12);
}

TEST(HighPass, OutlinesDoNotCount) {
  std::vector<float> image(7 * 7, 0.0f);
  std::vector<std::uint8_t> covered(7 * 7, 0);
  for (int y = 1; y < 6; ++y) {
    for (int x = 1; x < 6; ++x) {
      image[y * 7 + x] = 0.5f;
      covered[y * 7 + x] = 255;
    }
  }
  EXPECT_GT(Energy(image, 1, 7, 7), 0.001);
  EXPECT_EQ(Energy(image, 1, 7, 7, covered), 0);
  covered.assign(49, 0);
  EXPECT_EQ(Energy(image, 1, 7, 7, covered), 0);  // no pixel counts
}

TEST(HighPass, WhatDoesNotFitIsAnError) {
  const std::vector<float> image(12, 0.5f);
  ExpectMessage(HighPassEnergy({image, 1, 3, 5}).status(), "12 values");
  const std::vector<std::uint8_t> covered(11, 1);
  ExpectMessage(HighPassEnergy({image, 1, 3, 4}, covered).status(), "11 marks");
  std::vector<float> broken = image;
  broken[3] = std::numeric_limits<float>::quiet_NaN();
  ExpectMessage(HighPassEnergy({broken, 1, 3, 4}).status(), "not finite");
}

}  // namespace tilegrad::train::metrics_test

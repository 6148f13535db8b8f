// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "base/rng.h"
#include "train/metrics/nearest_point.h"

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

}  // namespace tilegrad::train::metrics_test

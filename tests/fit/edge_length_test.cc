// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/rng.h"
#include "fit/diffusion.h"
#include "scene/shapes.h"
#include "train/losses/area_edge_length.h"

namespace tilegrad::train::edge_length_test {

std::vector<double> NoisyPositions(const Mesh& mesh) {
  std::vector<double> p;
  Rng rng(4);
  for (const glm::vec3& v : mesh.positions) {
    for (int c = 0; c < 3; ++c) p.push_back(static_cast<double>(v[c]) + rng.Uniform(-0.1, 0.1));
  }
  return p;
}

TEST(EdgeLength, GradientIsThatOfDifferences) {
  const Mesh mesh = Icosphere(1, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<double> p = NoisyPositions(mesh), d(p.size(), 0.0);
  EdgeSums sums, other;
  EXPECT_GT(EdgeLengthForward<double>(topology, p, &sums), 0.001);
  AddEdgeLengthGradient<double>(topology, p, sums, 1.0, d);
  // Central differences in double: truncation h^2 and rounding 1e-16 / h, both near 1e-10.
  constexpr double h = 1e-5;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double at = p[i];
    p[i] = at + h;
    const double above = EdgeLengthForward<double>(topology, p, &other);
    p[i] = at - h;
    const double below = EdgeLengthForward<double>(topology, p, &other);
    p[i] = at;
    EXPECT_NEAR(d[i], (above - below) / (2 * h), 1e-8) << i;
  }
}

TEST(EdgeLength, SizeDoesNotMatterAndNoExtentIsZero) {
  const Mesh mesh = Icosphere(1, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<double> p = NoisyPositions(mesh);
  EdgeSums sums;
  const double value = EdgeLengthForward<double>(topology, p, &sums);
  for (double& x : p) x *= 7;
  EXPECT_NEAR(EdgeLengthForward<double>(topology, p, &sums), value, 1e-12);
  std::vector<double> zero(p.size(), 0.0), d(p.size(), 0.0);
  EXPECT_EQ(EdgeLengthForward<double>(topology, zero, &sums), 0);
  AddEdgeLengthGradient<double>(topology, zero, sums, 1.0, d);
  EXPECT_EQ(d, zero);
}

// Of a large mesh what is left of the sums' quotient is 4e-3 of it: sums in float, of 500,000 edges
// one after the other, would be off by a third. Lengths in float cost 1e-7 each.
TEST(EdgeLength, FloatIsRightOnALargeMesh) {
  const Mesh mesh = Icosphere(7, 0.5f);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<float> p;
  for (const glm::vec3& v : mesh.positions) {
    for (int c = 0; c < 3; ++c) p.push_back(v[c]);
  }
  const std::vector<double> exact(p.begin(), p.end());
  std::vector<float> d(p.size(), 0.0f);
  std::vector<double> d_exact(p.size(), 0.0);
  EdgeSums sums, sums_exact;
  const double value = EdgeLengthForward<double>(topology, exact, &sums_exact);
  EXPECT_NEAR(EdgeLengthForward<float>(topology, p, &sums), value, 1e-4 * value);
  AddEdgeLengthGradient<float>(topology, p, sums, 1.0f, d);
  AddEdgeLengthGradient<double>(topology, exact, sums_exact, 1.0, d_exact);
  double gap = 0, norm = 0;
  for (std::size_t i = 0; i < d.size(); ++i) {
    gap += std::pow(static_cast<double>(d[i]) - d_exact[i], 2);
    norm += d_exact[i] * d_exact[i];
  }
  EXPECT_LT(std::sqrt(gap / norm), 1e-4);
}

// Applying (1 + lambda L) to what Diffusion gives is the identity, to its residual.
TEST(Diffusion, SolvesItsSystem) {
  const Mesh mesh = Icosphere(2, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  const std::vector<double> noisy = NoisyPositions(mesh);
  const std::vector<float> right(noisy.begin(), noisy.end());
  std::vector<float> x = right;
  constexpr float lambda = 12;
  Diffusion(topology, lambda).Apply(x);
  double gap = 0, norm = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int32_t begin = topology.offsets[v], end = topology.offsets[v + 1];
      float sum = static_cast<float>(end - begin) * x[3 * v + c];
      for (std::int32_t n = begin; n < end; ++n) {
        sum -= x[3 * static_cast<std::size_t>(topology.neighbors[static_cast<std::size_t>(n)]) + c];
      }
      const float left = x[3 * v + c] + lambda * sum;
      gap += std::pow(static_cast<double>(left - right[3 * v + c]), 2);
      norm += std::pow(static_cast<double>(right[3 * v + c]), 2);
    }
  }
  // The check itself rounds 2 lambda degree * 6e-8.
  EXPECT_LT(std::sqrt(gap / norm), 1e-5);
}

TEST(Diffusion, LambdaZeroChangesNothing) {
  const Mesh mesh = Icosphere(0, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<float> x(36, 1.5f);
  x[3] = -2;
  const std::vector<float> before = x;
  Diffusion(topology, 0).Apply(x);
  EXPECT_EQ(x, before);
}

}  // namespace tilegrad::train::edge_length_test

// SPDX-License-Identifier: Apache-2.0
// Gradients of the losses against central differences in float64, f32 against f64, and independent
// numbers where they are at hand.
#include <gtest/gtest.h>

#include "gradient_check.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "support/shared_data.h"
#include "train/losses/area_edge_length.h"
#include "train/losses/iou.h"
#include "train/losses/l1.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train::losses_test {

using Losses = GradientCheck;

TEST_F(Losses, IouGradient) {
  const nn::Shape shape = {3, 5, 4};
  const auto truth = Random(shape, 0, 1, 1);
  ExpectGradient([&](const nn::Var& a) { return IouLoss(a, truth); }, shape, Uniform(60, 0, 1, 2));
}

TEST_F(Losses, IouKnownValues) {
  const nn::Shape shape = {2, 4};
  const auto truth = context_.From(shape, std::span<const double>({1.0, 1, 0, 0, 0, 0, 0, 0}));
  const auto value = [&](std::vector<double> a) {
    return Value([&](const nn::Var& x) { return IouLoss(x, truth); }, shape, a);
  };
  // The first image is perfect; the second, empty against empty, counts as loss 1.
  EXPECT_NEAR(value({1, 1, 0, 0, 0, 0, 0, 0}), 0.5, 1e-9);
  EXPECT_NEAR(value({0, 1, 1, 0, 1, 0, 0, 0}), 0.5 * (2.0 / 3 + 1), 1e-9);
}

TEST_F(Losses, ColorGradientAwayFromKinks) {
  const nn::Shape shape = {2, 3, 3, 2};
  const auto truth = Random(shape, 0, 0.4, 3);
  ExpectGradient([&](const nn::Var& a) { return ColorL1Loss(a, truth); }, shape,
                 Uniform(36, 0.5, 1, 4));
}

// Four images side by side, then the two that are left, to the bit.
TEST_F(Losses, ColorSumsTheDifferencesOfEachImageInOrder) {
  const nn::Shape shape = {6, 3, 5, 7};
  const auto truth = Random(shape, 0, 1, 3);
  const std::vector<double> image = Uniform(630, 0, 1, 4);
  double sum = 0;
  for (std::size_t i = 0; i < 6; ++i)
    sum += AbsoluteDifference<double>(truth.span<double>().subspan(105 * i, 105),
                                      std::span(image).subspan(105 * i, 105));
  EXPECT_EQ(Value([&](const nn::Var& a) { return ColorL1Loss(a, truth); }, shape, image),
            3.0 / 630 * sum);
}

TEST_F(Losses, HuberGradientOnBothSidesOfItsBend) {
  const nn::Shape shape = {2, 3, 3, 2};
  const auto truth = Random(shape, 0, 0.4, 3);
  ExpectGradient([&](const nn::Var& a) { return ColorHuberLoss(a, truth, 0.3); }, shape,
                 Uniform(36, 0, 1, 4));
}

TEST_F(Losses, HuberKnownValues) {
  const nn::Shape shape = {1, 1, 1, 2};
  const auto truth = context_.Zeros(shape);
  // 0.2^2 / (2 x 0.4) and 1 - 0.2
  EXPECT_NEAR(
      Value([&](const nn::Var& a) { return ColorHuberLoss(a, truth, 0.4); }, shape, {0.2, -1}),
      (0.05 + 0.8) / 2, 1e-12);
}

TEST_F(Losses, WeightedColorGradientAndValue) {
  const nn::Shape shape = {2, 3, 3, 2};
  const auto truth = context_.From(shape, std::span<const double>(Uniform(36, 0, 0.4, 3)));
  const auto weight = context_.From({2, 3, 2}, std::span<const double>(Uniform(12, 0, 1, 9)));
  ExpectGradient([&](const nn::Var& a) { return WeightedColorL1Loss(a, truth, weight); }, shape,
                 Uniform(36, 0.5, 1, 4));
  // Weights 1 and 0.5 of a pixel each, differences 1 and 0.4 in all channels.
  const auto black = context_.Zeros({1, 3, 1, 2});
  const auto halves = context_.From({1, 1, 2}, std::span<const double>({1.0, 0.5}));
  EXPECT_NEAR(Value([&](const nn::Var& a) { return WeightedColorL1Loss(a, black, halves); },
                    {1, 3, 1, 2}, {1, 0.4, 1, 0.4, 1, 0.4}),
              (1 + 0.5 * 0.4) / 2, 1e-12);
}

TEST_F(Losses, SquaredSilhouetteGradientAndValue) {
  const nn::Shape shape = {3, 5, 4};
  const auto truth = context_.From(shape, std::span<const double>(Uniform(60, 0, 1, 1)));
  ExpectGradient([&](const nn::Var& a) { return SquaredSilhouetteLoss(a, truth); }, shape,
                 Uniform(60, 0, 1, 2));
  // (0.5^2 + 0.2^2) over an area of 2, and 0.3^2 over nothing, which counts as 1.
  const auto known = context_.From({2, 2}, std::span<const double>({1.0, 1, 0, 0}));
  EXPECT_NEAR(Value([&](const nn::Var& a) { return SquaredSilhouetteLoss(a, known); }, {2, 2},
                    {0.5, 0.8, 0.3, 0}),
              0.5 * (0.29 / 2 + 0.09), 1e-9);
}

TEST_F(Losses, EdgeLengthAndAreaGradients) {
  const Mesh mesh = Icosphere(1, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<double> x = Uniform(6 * mesh.positions.size(), -0.2, 0.2, 6);
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] += mesh.positions[i / 3 % mesh.positions.size()][static_cast<int>(i % 3)];
  const nn::Shape shape = {2, static_cast<std::int64_t>(mesh.positions.size()), 3};
  ExpectGradient([&](const nn::Var& p) { return EdgeLengthLoss(p, topology); }, shape, x);
  ExpectGradient([&](const nn::Var& p) { return AreaLoss(p, mesh.faces); }, shape, x);
}

TEST_F(Losses, AreaOfABoxAndOfNothing) {
  const Mesh box = Box({0, 0, 0}, {2, 1, 3});
  std::vector<double> x;
  for (const glm::vec3& p : box.positions) x.insert(x.end(), {p.x, p.y, p.z});
  const nn::Shape shape = {1, static_cast<std::int64_t>(box.positions.size()), 3};
  const auto area = [&](const std::vector<double>& of) {
    return Value([&](const nn::Var& p) { return AreaLoss(p, box.faces); }, shape, of);
  };
  EXPECT_NEAR(area(x), 2 * (2 * 1 + 1 * 3 + 3 * 2), 1e-9);
  EXPECT_EQ(area(std::vector<double>(x.size(), 0.0)), 0);
}

TEST_F(Losses, LaplacianGradient) {
  const Mesh mesh = Icosphere(1, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  const auto vertices = static_cast<std::int64_t>(mesh.positions.size());
  ExpectGradient([&](const nn::Var& m) { return LaplacianLoss(m, topology); }, {2, vertices, 3},
                 Uniform(6 * mesh.positions.size(), -1, 1, 5));
  // A translation has no relative movement.
  EXPECT_NEAR(Value([&](const nn::Var& m) { return LaplacianLoss(m, topology); }, {1, vertices, 3},
                    std::vector<double>(3 * mesh.positions.size(), 0.7)),
              0, 1e-25);
}

TEST_F(Losses, SmoothnessGradient) {
  const Mesh mesh = Icosphere(1, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  std::vector<double> x;
  for (int copy = 0; copy < 2; ++copy) {
    for (const glm::vec3& p : mesh.positions) x.insert(x.end(), {p.x, p.y, p.z});
  }
  const auto noise = Uniform(x.size(), -0.2, 0.2, 6);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += noise[i];
  ExpectGradient([&](const nn::Var& p) { return SmoothnessLoss(p, mesh.faces, topology); },
                 {2, static_cast<std::int64_t>(mesh.positions.size()), 3}, x);
}

TEST_F(Losses, SmoothnessIsFiniteForCollapsedFaces) {
  const Mesh mesh = Icosphere(0, 1);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  const nn::Var p = nn::Parameter(context_, context_.Zeros({1, 12, 3}));
  const nn::Var loss = SmoothnessLoss(p, mesh.faces, topology);
  EXPECT_EQ(loss.item(), 0);
  const nn::Var gradient = nn::Grad(loss, {p})[0];
  for (const double g : gradient.value().span<double>()) EXPECT_EQ(g, 0);
}

// Half a million terms, one after the other: in float the sums would lose 1e-4 (movement) and 4e-4
// (angles). What remains is the rounding of each term, which averages out.
TEST_F(Losses, MeshLossesInFloatAreRightOnALargeMesh) {
  const Mesh mesh = Icosphere(7, 0.5f);
  const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
  const auto noise = Uniform(3 * mesh.positions.size(), -1e-3, 1e-3, 7);
  const std::vector<float> movement(noise.begin(), noise.end());
  std::vector<float> positions = movement, residual(movement.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i] += mesh.positions[i / 3][static_cast<int>(i % 3)];
  }
  const std::vector<double> exact_movement(movement.begin(), movement.end()),
      exact_positions(positions.begin(), positions.end());
  std::vector<double> exact_residual(movement.size());
  std::vector<FaceNormal<float>> normals;
  std::vector<FaceNormal<double>> exact_normals;
  const double laplacian = LaplacianForward<double>(topology, exact_movement, exact_residual);
  const double smoothness =
      SmoothnessForward<double>(topology, mesh.faces, exact_positions, exact_normals);
  EXPECT_NEAR(LaplacianForward<float>(topology, movement, residual), laplacian, 1e-6 * laplacian);
  EXPECT_NEAR(SmoothnessForward<float>(topology, mesh.faces, positions, normals), smoothness,
              1e-5 * smoothness);
}

TEST_F(Losses, ShapesThatDoNotFitAreErrors) {
  const nn::Var a = nn::Constant(context_, context_.Zeros({2, 4}));
  EXPECT_FALSE(IouLoss(a, context_.Zeros({2, 5})).valid());
  EXPECT_FALSE(context_.TakeStatus().ok());
}

// Numbers of other implementations (the README of the vectors says whose): f64 against f64, so sums
// of a hundred terms agree to 1e-9.
class LossVectors : public Losses {
 protected:
  void SetUp() override {
    TILEGRAD_VECTORS_OR_SKIP(json, "09_mesh_and_mask_losses.json");
    json_ = json;
    faces_ = json_["faces"].get<std::vector<Face>>();
  }
  std::vector<double> Numbers(const std::string& key) const {
    return tilegrad::Numbers(json_[key]);
  }
  void ExpectMatches(const Function& loss, const nn::Shape& shape, const std::string& input,
                     const std::string& value, const std::string& gradient) {
    const nn::Var x =
        nn::Parameter(context_, context_.From(shape, std::span<const double>(Numbers(input))));
    const nn::Var result = loss(x);
    EXPECT_NEAR(result.item(), json_[value].get<double>(), 1e-9);
    const nn::Var d_x = nn::Grad(result, {x})[0];
    const auto want = Numbers(gradient);
    for (std::size_t i = 0; i < want.size(); ++i)
      EXPECT_NEAR(d_x.value().data<double>()[i], want[i], 1e-9);
  }
  Json json_;
  std::vector<Face> faces_;
};

TEST_F(LossVectors, Iou) {
  const auto truth = context_.From({2, 4, 4}, std::span<const double>(Numbers("mask_rhs")));
  ExpectMatches([&](const nn::Var& a) { return IouLoss(a, truth); }, {2, 4, 4}, "mask_lhs",
                "kaolin_mask_iou_loss", "kaolin_mask_iou_grad_lhs");
}

TEST_F(LossVectors, Laplacian) {
  const Topology topology = BuildTopology(faces_, 12);
  ExpectMatches([&](const nn::Var& m) { return LaplacianLoss(m, topology); }, {2, 12, 3},
                "movement", "dibr_laplacian_loss", "dibr_laplacian_grad_movement");
}

TEST_F(LossVectors, Smoothness) {
  const Topology topology = BuildTopology(faces_, 12);
  ExpectMatches([&](const nn::Var& p) { return SmoothnessLoss(p, faces_, topology); }, {2, 12, 3},
                "vertices", "dibr_flatten_loss", "dibr_flatten_grad_vertices");
}

}  // namespace tilegrad::train::losses_test

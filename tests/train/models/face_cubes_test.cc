// SPDX-License-Identifier: Apache-2.0
#include "train/models/face_cubes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/shapes.h"

namespace tilegrad::train::face_cubes_test {

constexpr std::int64_t kSide = 64;

// Bands of latitude and longitude, once around the sphere.
nn::Tensor SmoothMap(nn::Context& context) {
  std::vector<double> texels;
  for (std::int64_t t = 0; t < kSide * kSide; ++t) {
    const double u = (static_cast<double>(t % kSide) + 0.5) / kSide;
    const double v = (static_cast<double>(t / kSide) + 0.5) / kSide;
    const double ring = std::sin(std::numbers::pi * v);
    for (const double turn : {0.0, 1.0, 2.0})
      texels.push_back(0.5 + 0.4 * ring * std::cos(2 * std::numbers::pi * u + turn));
  }
  return context.From({1, kSide, kSide, 3}, std::span<const double>(texels));
}

// A map that varies little within a face comes back, seam and poles included.
TEST(FaceCubes, KeepWhatIsSmooth) {
  const Workers workers(1);
  nn::Context context(workers);
  const FaceCubes cubes(context, Icosphere(3, 0.3f), kSide);
  const nn::Var map = nn::Constant(context, SmoothMap(context));
  const nn::Var of_faces = cubes.Cubes(map);
  EXPECT_EQ(of_faces.shape(), (nn::Shape{1, 1280, 8, 3}));
  const nn::Var back = cubes.Maps(of_faces);
  ASSERT_EQ(back.shape(), map.shape());
  EXPECT_LT(nn::ReduceMax(nn::Abs(back - map), {0, 1, 2, 3}).item(), 0.06);
  EXPECT_LT(nn::Mean(nn::Abs(back - map)).item(), 0.01);
  const nn::Var grey = nn::Constant(context, context.Full({1, kSide, kSide, 3}, 0.25));
  EXPECT_LT(nn::ReduceMax(nn::Abs(cubes.Maps(cubes.Cubes(grey)) - grey), {0, 1, 2, 3}).item(),
            1e-6);
}

// A face has eight numbers: checks of single texels are gone.
TEST(FaceCubes, LoseWhatIsFinerThanAFace) {
  const Workers workers(1);
  nn::Context context(workers);
  const FaceCubes cubes(context, Icosphere(2, 0.3f), kSide);
  std::vector<double> texels;
  for (std::int64_t t = 0; t < kSide * kSide; ++t) {
    for (int c = 0; c < 3; ++c) texels.push_back(static_cast<double>((t + t / kSide) % 2));
  }
  const nn::Var map =
      nn::Constant(context, context.From({1, kSide, kSide, 3}, std::span<const double>(texels)));
  EXPECT_GT(nn::Mean(nn::Abs(cubes.Maps(cubes.Cubes(map)) - map)).item(), 0.3);
}

TEST(FaceLight, IsTheCosineOfOutwardNormals) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Mesh ball = Icosphere(1, 0.5f);
  const std::span<const float> flat(&ball.positions[0].x, 3 * ball.positions.size());
  const auto vertices = static_cast<std::int64_t>(ball.positions.size());
  const nn::Var positions = nn::Parameter(context, context.From({1, vertices, 3}, flat));
  const std::vector<double> direction = {0.6, 0, 0.8};
  const nn::Var light =
      nn::Parameter(context, context.From({1, 3}, std::span<const double>(direction)));
  const nn::Var shade = FaceLight(positions, ball.faces, light, 0.1);
  int dark = 0;
  for (std::size_t f = 0; f < ball.faces.size(); ++f) {
    const auto corner = [&](std::size_t k) {
      return glm::dvec3(ball.positions[static_cast<std::size_t>(ball.faces[f][k])]);
    };
    const glm::dvec3 n = glm::normalize(glm::cross(corner(1) - corner(0), corner(2) - corner(0)));
    const double cosine = 0.6 * n.x + 0.8 * n.z;
    EXPECT_NEAR(shade.value().data<double>()[f], 0.1 + std::max(0.0, cosine), 1e-6);
    dark += cosine < 0 ? 1 : 0;
  }
  EXPECT_GT(dark, 20);
  Rng rng(5);
  const auto loss = [&] {
    return nn::Sum(nn::Square(FaceLight(positions, ball.faces, light, 0.1)));
  };
  nn::ExpectGradientBy({positions, light}, loss, rng);
}

}  // namespace tilegrad::train::face_cubes_test

// SPDX-License-Identifier: Apache-2.0
// Lights of cameras in the world: the same light on the same surface, and gradients of the turn.
#include "train/ops/light_frames.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/rng.h"
#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/camera.h"
#include "scene/light_frame.h"
#include "shade/spherical_harmonics_ref.h"

namespace tilegrad::train::light_frames_test {

std::vector<Camera> SomeCameras() {
  return {OrbitCamera(Lens{}, 0, 0, 2), OrbitCamera(Lens{}, 50, 20, 2),
          OrbitCamera(Lens{}, 250, -70, 3)};
}

std::vector<double> Random(std::size_t count, Rng& rng) {
  std::vector<double> out(count);
  for (double& x : out) x = rng.Uniform(-1, 1);
  return out;
}

shade::Vec3<double> UnitNormal(Rng& rng) {
  const std::vector<double> v = Random(3, rng);
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return {v[0] / length, v[1] / length, v[2] / length};
}

shade::Vec3<double> ToCamera(const Camera& camera, const shade::Vec3<double>& n) {
  shade::Vec3<double> out = {};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      out[static_cast<std::size_t>(i)] +=
          static_cast<double>(camera.rotation[3 * i + k]) * n[static_cast<std::size_t>(k)];
  }
  return out;
}

double LightAt(std::span<const double> sh, const shade::Vec3<double>& n) {
  return shade::ShLightRef(shade::ShPolynomialOf<double>(sh), n);
}

// A normal of the world and the same one in the camera's axes have the same light. Rotations are of
// floats, so 1e-6.
TEST(LightFrames, HarmonicsShineOnTheSameSides) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const std::vector<Camera> cameras = SomeCameras();
  Rng rng(2);
  const std::vector<double> seen = Random(9 * cameras.size(), rng);
  const nn::Var world = HarmonicsToWorld(
      nn::Constant(context, context.From({3, 9}, std::span<const double>(seen))), cameras);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  for (std::size_t n = 0; n < cameras.size(); ++n) {
    std::array<float, 9> row;
    for (std::size_t i = 0; i < 9; ++i) row[i] = static_cast<float>(seen[9 * n + i]);
    const std::array<float, 9> alone = HarmonicsToWorld(row, cameras[n]);
    const auto got = world.value().span<double>().subspan(9 * n, 9);
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(alone[i], got[i], 1e-6);
    for (int k = 0; k < 20; ++k) {
      const shade::Vec3<double> normal = UnitNormal(rng);
      EXPECT_NEAR(LightAt(got, normal),
                  LightAt(std::span(seen).subspan(9 * n, 9), ToCamera(cameras[n], normal)), 1e-6);
    }
  }
}

TEST(LightFrames, DirectionsKeepTheirAngles) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const std::vector<Camera> cameras = SomeCameras();
  Rng rng(3);
  const std::vector<double> seen = Random(9, rng);
  const nn::Var world = DirectionsToWorld(
      nn::Constant(context, context.From({3, 3}, std::span<const double>(seen))), cameras);
  for (std::size_t n = 0; n < 3; ++n) {
    const double* const d = world.value().data<double>() + 3 * n;
    const shade::Vec3<double> back = ToCamera(cameras[n], {d[0], d[1], d[2]});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(back[i], seen[3 * n + i], 1e-6);
  }
}

TEST(LightFrames, GradientsAgreeWithDifferences) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const std::vector<Camera> cameras = SomeCameras();
  Rng rng(4);
  for (const std::int64_t numbers : {3, 9}) {
    const nn::Var x = nn::RandomParameter(context, {{3, numbers}}, rng),
                  w = nn::RandomConstant(context, {3, numbers}, rng);
    const auto loss = [&] {
      return nn::Sum(w *
                     (numbers == 3 ? DirectionsToWorld(x, cameras) : HarmonicsToWorld(x, cameras)));
    };
    nn::ExpectGradientBy({x}, loss, rng);
  }
}

TEST(LightFrames, OneLightForEachCamera) {
  const Workers workers(1);
  nn::Context context(workers);
  DirectionsToWorld(nn::Constant(context, context.Full({2, 3}, 1.0)), SomeCameras());
  EXPECT_NE(context.TakeStatus().message().find("lights [2, 3] of 3 cameras"), std::string::npos);
}

}  // namespace tilegrad::train::light_frames_test

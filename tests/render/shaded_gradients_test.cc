// SPDX-License-Identifier: Apache-2.0
// Gradients of everything, of every shading model, over random scenes: the reference is held to
// complex steps in double. The renderer is held to the reference in shaded_simd_test.cc.
#include <gtest/gtest.h>

#include <complex>
#include <map>
#include <string>

#include "render/shaded/owned_rendering.h"
#include "render/shaded_trial.h"

namespace tilegrad {
namespace {

using Complex = std::complex<double>;
using test::SceneRecipe;

constexpr double kStep = 1e-40;

template <class T, class U>
T Weighted(const AlignedVector<T>& image, const std::vector<U>& weights, std::size_t pixels,
           const std::vector<std::int32_t>& ids) {
  T sum = T(0);
  for (std::size_t i = 0; i < image.size(); ++i) {
    const bool finite = std::isfinite(RealPart(image[i]));  // depth of the background is not
    if (finite || ids[i % pixels] >= 0) sum += image[i] * T(weights[i]);
  }
  return sum;
}

// Sum of all images times their cotangents.
Complex LossOf(OwnedScene<Complex>& scene, const std::vector<std::int32_t>& ids,
               const OwnedCotangents<double>& d) {
  ShadedFrameT<Complex> frame;
  ShadedRenderRef<Complex>(scene.View(), test::TrialOptions(), test::EveryImage(), ids, &frame);
  return Weighted(frame.color, d.color, test::kTrialPixels, ids) +
         Weighted(frame.alpha, d.alpha, test::kTrialPixels, ids) +
         Weighted(frame.normals, d.normals, test::kTrialPixels, ids) +
         Weighted(frame.uv, d.uv, test::kTrialPixels, ids) +
         Weighted(frame.depth, d.depth, test::kTrialPixels, ids) +
         Weighted(frame.attributes, d.attributes, test::kTrialPixels, ids);
}

// Whether scenes of a model were seen, and their gradients not all 0.
using SeenKinds = std::map<std::string, int>;

void CheckComplexStep(const SceneRecipe& recipe, std::uint64_t seed, SeenKinds* seen) {
  test::Trial trial(recipe, seed);
  if (!trial.seen) return;
  auto scene = OwnedCast<double>(trial.scene);
  OwnedScene<double> gradients =
      OwnedRefBackward<double>(scene, test::TrialOptions(), trial.d_frame, trial.ids);

  std::map<std::string, std::vector<double>> values;  // of the gradient
  ForEachNumber(gradients, [&](const char* name, double& d) { values[name].push_back(d); });
  for (const auto& kind : values) {
    const std::string& name = kind.first;
    const std::vector<double>& d = kind.second;
    Rng rng(seed, std::hash<std::string>()(name));
    auto moved = OwnedCast<Complex>(trial.scene);
    double expected = 0, scale = 0;
    std::size_t i = 0;
    ForEachNumber(moved, [&](const char* of, Complex& x) {
      if (of != name) return;
      const double along = rng.Uniform(-1, 1);
      x += Complex(0, along * kStep);
      expected += d[i] * along, scale += std::abs(d[i] * along), ++i;
    });
    const double step = LossOf(moved, trial.ids, trial.d_frame).imag() / kStep;
    // A few hundred roundings for each of the terms, and of the loss itself.
    EXPECT_NEAR(step, expected, 1e-11 * (scale + 1))
        << recipe.name << " seed " << seed << " " << name;
    if (scale > 0) ++(*seen)[name];
  }
}

void ExpectKinds(const SceneRecipe& recipe, const SeenKinds& seen, int least) {
  for (const auto& kind : test::KindsOf(recipe)) {
    const auto found = seen.find(kind);
    EXPECT_GE(found == seen.end() ? 0 : found->second, least) << recipe.name << ": " << kind;
  }
}

// More than `least`: some scenes are empty, or have no light where they are seen.
void ComplexStepOver(const SceneRecipe& recipe, std::uint64_t first, int least) {
  SeenKinds seen;
  std::uint64_t seed = first;
  for (int n = 0; n < least * 13 / 10 && !testing::Test::HasFailure(); ++n) {
    CheckComplexStep(recipe, seed++, &seen);
  }
  ExpectKinds(recipe, seen, least);
}

class ShadedGradients : public testing::TestWithParam<SceneRecipe> {};
class ShadedGradientsLong : public ShadedGradients {};

TEST_P(ShadedGradients, ReferenceIsTheComplexStep) { ComplexStepOver(GetParam(), 1, 10); }
TEST_P(ShadedGradientsLong, ReferenceIsTheComplexStep) { ComplexStepOver(GetParam(), 1000, 1000); }

INSTANTIATE_TEST_SUITE_P(Models, ShadedGradients, testing::ValuesIn(test::kRecipes),
                         [](const auto& p) { return std::string(p.param.name); });
INSTANTIATE_TEST_SUITE_P(Models, ShadedGradientsLong, testing::ValuesIn(test::kRecipes),
                         [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace tilegrad

// SPDX-License-Identifier: Apache-2.0
// Gradients of everything, of every shading model, over random scenes: the reference is held to
// complex steps in double. The renderer is held to the reference in renderer_simd_test.cc.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "proof/complex_step.h"
#include "render/trial.h"

namespace tilegrad::renderer_gradients_test {

using test::SceneRecipe;

// Whether scenes of a model were seen, and their gradients not all 0.
using SeenKinds = std::map<std::string, int>;

void CheckComplexStep(const SceneRecipe& recipe, std::uint64_t seed, SeenKinds* seen) {
  test::Trial trial(recipe, seed);
  if (!trial.seen) return;
  const SlopeProblem problem{trial.scene, trial.options, trial.images, trial.ids, trial.d_frame};
  auto scene = OwnedCast<double>(trial.scene);
  OwnedScene<double> gradients =
      OwnedRefBackward<double>(scene, trial.options, trial.d_frame, trial.ids);

  std::map<std::string, std::vector<double>> values;  // of the gradient
  ForEachNumber(gradients, [&](const char* name, double& d) { values[name].push_back(d); });
  for (const auto& kind : values) {
    const std::string& name = kind.first;
    const std::vector<double>& d = kind.second;
    const Slope slope = SlopeAlong(problem, name, d, Rng(seed, std::hash<std::string>()(name)));
    EXPECT_NEAR(slope.by_step, slope.by_gradient, slope.rounding())
        << recipe.name << " seed " << seed << " " << name;
    if (slope.size > 0) ++(*seen)[name];
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

}  // namespace tilegrad::renderer_gradients_test

// SPDX-License-Identifier: Apache-2.0
// Gradients of everything, of every shading model, over random scenes: the reference is held to
// complex steps in double. The renderer is held to the reference in renderer_gradients_test.cc.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "proof/complex_step.h"
#include "proof/owned_scene.h"
#include "render/trial.h"
#include "support/expect.h"

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

// The Renderer against the reference in double, over random scenes of every shading model
// and on every instruction set: images, and gradients of everything.

using test::Trial;

struct Rendered {
  OwnedRendering<float> got;
  OwnedRendering<double> truth;
};

Rendered RenderBoth(Trial& trial) {
  Rendered out;
  const Workers workers(2);
  Ok(RenderOwned(trial.scene, trial.options, trial.images, trial.d_frame.Cast<float>(), workers,
                 &out.got));
  auto scene64 = OwnedCast<double>(trial.scene);
  out.truth = RenderOwnedRef<double>(scene64, trial.options, trial.images, trial.d_frame,
                                     out.got.frame.face_ids);
  return out;
}

// Largest difference of two lists of numbers, in units of the largest of the second.
struct Compared {
  double off = 0, most = 0;
  bool finite = true;
  double relative() const { return off / std::max(most, 1e-3); }
};

void Compare(double got, double expected, Compared* c) {
  if (std::isinf(expected) && got == expected) return;
  c->finite = c->finite && std::isfinite(got) && std::isfinite(expected);
  c->off = std::max(c->off, std::abs(got - expected));
  c->most = std::max(c->most, std::abs(expected));
}

std::map<std::string, Compared> CompareGradients(Rendered& r) {
  std::map<std::string, Compared> out;
  std::vector<double> truth;
  ForEachNumber(r.truth.d, [&](const char*, double& d) { truth.push_back(d); });
  std::size_t i = 0;
  ForEachNumber(r.got.d, [&](const char* name, float& d) {
    Compare(static_cast<double>(d), truth[i++], &out[name]);
  });
  return out;
}

void CompareImage(const char* name, const AlignedVector<float>& got,
                  const AlignedVector<double>& truth, std::map<std::string, Compared>* out) {
  ASSERT_EQ(got.size(), truth.size()) << name;
  for (std::size_t i = 0; i < got.size(); ++i) {
    Compare(static_cast<double>(got[i]), truth[i], &(*out)[name]);
  }
}

std::map<std::string, Compared> CompareImages(const Rendered& r) {
  std::map<std::string, Compared> out;
  CompareImage("color", r.got.frame.color, r.truth.frame.color, &out);
  CompareImage("normals", r.got.frame.normals, r.truth.frame.normals, &out);
  CompareImage("uv", r.got.frame.uv, r.truth.frame.uv, &out);
  CompareImage("alpha", r.got.frame.alpha, r.truth.frame.alpha, &out);
  CompareImage("depth", r.got.frame.depth, r.truth.frame.depth, &out);
  CompareImage("attributes", r.got.frame.attributes, r.truth.frame.attributes, &out);
  return out;
}

struct Tally {
  int trials = 0, far = 0;
  std::map<std::string, int> seen;  // scenes in which a number of the kind is not 0
};

// Screen coordinates are sums and products of a handful of floats of the size of the image, W: they
// err by about 4 eps W pixels, which moves a weight of a face of a quarter of a pixel in height by
// 16 eps W; 1e-5 more is for the few operations on weights. A gradient has one weight and one
// 1/height more and errs by eight times that, relative to its largest entry: 3e-4 here. Shading
// multiplies an error at most by the shininess (12) or the texels of a side (6), but of one factor
// among several: three times are allowed.
constexpr double kTolerance = 1e-3;

void Check(const SceneRecipe& recipe, std::uint64_t seed, Tally* tally) {
  Trial trial(recipe, seed);
  if (!trial.seen) return;
  Rendered r = RenderBoth(trial);
  bool far = false;
  for (const auto& all : {CompareImages(r), CompareGradients(r)}) {
    for (const auto& [name, c] : all) {
      EXPECT_TRUE(c.finite) << recipe.name << " seed " << seed << " " << name;
      if (c.most > 0) ++tally->seen[name];
      far |= c.relative() > kTolerance;
    }
  }
  ++tally->trials;
  tally->far += far;
}

class ShadedSimd : public testing::TestWithParam<SceneRecipe> {
 protected:
  // Rounding may put a pixel on the other side of a choice (texel, clamp, horizon), whose gradient
  // jumps: one scene in 500 may be off by that.
  void Over(std::uint64_t first, int least) {
    for (const std::string target : EveryTarget()) {
      Tally tally;
      for (int n = 0; n < least * 13 / 10; ++n) {
        Check(GetParam(), first + static_cast<std::uint64_t>(n), &tally);
      }
      EXPECT_LE(tally.far, tally.trials / 500);
      for (const auto& kind : test::KindsOf(GetParam())) {
        EXPECT_GE(tally.seen[kind], least) << kind;
      }
    }
  }
};
class ShadedSimdLong : public ShadedSimd {};

TEST_P(ShadedSimd, IsTheReference) { Over(1, 40); }
TEST_P(ShadedSimdLong, IsTheReference) { Over(1000, 1000); }

INSTANTIATE_TEST_SUITE_P(Models, ShadedSimd, testing::ValuesIn(test::kRecipes),
                         [](const auto& p) { return std::string(p.param.name); });
INSTANTIATE_TEST_SUITE_P(Models, ShadedSimdLong, testing::ValuesIn(test::kRecipes),
                         [](const auto& p) { return std::string(p.param.name); });

}  // namespace tilegrad::renderer_gradients_test

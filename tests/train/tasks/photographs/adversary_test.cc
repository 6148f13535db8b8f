// SPDX-License-Identifier: Apache-2.0
// Section 5.4 with the terms of section 5.3: a second stage that starts as another run and has a
// critic trains it and logs it, and its gradients are right. Its bits: every_task_test.cc.
#include <gtest/gtest.h>

#include <algorithm>

#include "nn/nn.h"
#include "train/data/photographs/miniature.h"
#include "train/run/log.h"
#include "train/same_run.h"
#include "train/tasks/photographs/step.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::adversary_test {

constexpr int kSteps = 12;  // of kTinyPhotographs

class PhotographsWithACritic : public TinyRunTest {
 protected:
  PhotographsWithACritic() { WriteMiniature(folder_ / "cub", "cub"); }

  Status TrainFirst() const {
    return Train({.run = "first", .config = kTinyPhotographs, .data = "cub"}).status();
  }
  Status TrainSecond() const {
    return Train(
               {.run = "second",
                .config = kTinyPhotographs,
                .settings = {"start.run=" + (folder_ / "first").string(), "adversarial.weight=0.5",
                             "adversarial.features=1", "adversarial.base=2",
                             "adversarial.halvings=2", "adversarial.learning_rate=1e-3"},
                .data = "cub"})
        .status();
  }
  nn::Context context_{workers_};
};

TEST_F(PhotographsWithACritic, IsKeptAndLoggedInASecondStage) {
  Ok(TrainFirst());
  Ok(TrainSecond());
  const auto tensors = FinalTensors(context_, folder_ / "second", kSteps);
  EXPECT_TRUE(std::any_of(tensors.begin(), tensors.end(), [](const nn::NamedTensor& tensor) {
    return tensor.name.starts_with("critic.");
  }));
  const auto log = Ok(ReadLog(folder_ / "second"));
  for (const char* name : {"adversarial", "critic_features", "critic_distance", "critic_penalty"}) {
    const auto& values = log->back().values;
    EXPECT_TRUE(std::any_of(values.begin(), values.end(), [&](const auto& value) {
      return value.first == name;
    })) << name;
  }
}

TEST_F(PhotographsWithACritic, StartsAsARunThatIsThere) { ExpectMessage(TrainSecond(), "first"); }

// In float64, by a central difference along a random direction of the texture's last layer: h as in
// task_test.cc.
TEST_F(PhotographsWithACritic, GradientsOfAStep) {
  PhotographsConfig config;
  config.network = {.code = {.base = 4, .most = 8, .levels = 2, .latent = 8},
                    .sphere = {.level = 1, .radius = 1, .smoothing = 2}};
  config.adversary = {.weight = 0.5, .features = 1, .base = 2, .halvings = 2};
  config.loss = {.keypoint = 0,
                 .mask = 0,
                 .camera = 0,
                 .deformation = 0,
                 .laplacian = 0,
                 .entropy = 0,
                 .color = 0};
  config.size = 16;
  config.render.sharpness = config.render.sharpness_start = 50;
  config.schedule.steps = 10;
  const PhotographSet set = OpenPhotographs(folder_ / "cub").value();
  const auto store = PhotoStore::Load(set, {0, 1, 2}, {}, 16, workers_, {});
  nn::Context context(workers_, nn::DType::kF64);
  PhotographStep step(context, config, {set.mean_keypoints, 15});
  const auto adversary = Adversary::Make(context, config.adversary, {.seed = 5}).value();
  step.SetAdversary(adversary.get());
  const PhotographBatch batch = GatherPhotographs(context, config, *store, {0, 1, 2}, 3);
  std::vector<nn::Var> vars;
  for (const auto& p : nn::Parameters(step.network().module())) vars.push_back(p.value);
  StepValues values;
  const auto gradients = nn::Grad(step.Loss(batch, 1, &values), vars);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  double largest = 0;
  for (std::size_t which = 0; which < vars.size(); ++which) {
    if (!gradients[which].valid()) continue;
    const std::span<double> value = vars[which].value().span<double>();
    const double slope = gradients[which].value().span<double>()[0], before = value[0];
    const auto at = [&](double h) {
      value[0] = before + h;
      StepValues ignored;
      return step.Loss(batch, 1, &ignored).item();
    };
    const double h = 1e-7, difference = (at(h) - at(-h)) / (2 * h);
    at(0);
    EXPECT_NEAR(slope, difference, 2e-3 * (1 + std::abs(difference))) << which;
    largest = std::max(largest, std::abs(slope));
  }
  EXPECT_GT(largest, 1e-3);  // something depends on the critic
}

}  // namespace tilegrad::train::adversary_test

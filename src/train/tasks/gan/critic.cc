// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/critic.h"

namespace tilegrad::train {
namespace {

// By GanCritic: of weights and interpolates.
constexpr std::uint64_t kGanCriticStreams[] = {0x637368, 0x637063, 0x637478};
constexpr CriticRole kGanRoles[] = {
    {.prefix = "critic_shape.",
     .keys = "critic",
     .adversarial = {"adversarial_shape", "Adversarial loss of silhouettes (− mean score)"},
     .distance = {"distance_shape", "Wasserstein estimate of the critic of silhouettes"},
     .penalty = {"penalty_shape", "Gradient penalty of the critic of silhouettes"},
     .gradient = {"gradient_shape", "Norm of the gradient of the critic of silhouettes"}},
    {.prefix = "critic_picture.",
     .keys = "critic",
     .adversarial = {"adversarial_picture", "Adversarial loss of pictures (− mean score)"},
     .distance = {"distance_picture", "Wasserstein estimate of the critic of pictures"},
     .penalty = {"penalty_picture", "Gradient penalty of the critic of pictures"},
     .gradient = {"gradient_picture", "Norm of the gradient of the critic of pictures"}},
    {.prefix = "critic_texture.",
     .keys = "critic",
     .adversarial = {"adversarial_texture", "Adversarial loss of texture maps (− mean score)"},
     .distance = {"distance_texture", "Wasserstein estimate of the critic of texture maps"},
     .penalty = {"penalty_texture", "Gradient penalty of the critic of texture maps"},
     .gradient = {"gradient_texture", "Norm of the gradient of the critic of texture maps"}}};

// Half a map is its mirror image beyond its edges; a whole one goes around.
nn::CriticShape GanCriticShape(const GanConfig& config, GanCritic critic) {
  nn::CriticShape shape{.base = config.critic.base,
                        .halvings = static_cast<int>(config.critic.halvings)};
  if (critic == GanCritic::kSilhouettes) shape.in = config.views;
  if (critic == GanCritic::kPictures) shape.in = 3 * config.views;
  if (critic != GanCritic::kTextures) return shape;
  shape.padding_mode =
      config.network.symmetric_texture ? nn::PadMode::kReplicate : nn::PadMode::kCircular;
  return shape;
}

// A critic's rate, and no average: critics predict nothing.
OptimizerConfig GanCriticOptimizer(const GanConfig& config) {
  OptimizerConfig out = config.optimizer;
  out.learning_rate = config.critic.learning_rate;
  out.average = 0;
  return out;
}

}  // namespace

LearnedCritic::Job JobOf(const GanConfig& config, GanCritic critic) {
  const auto which = static_cast<std::size_t>(critic);
  return {.role = kGanRoles[which],
          .shape = GanCriticShape(config, critic),
          .game = {.penalty = config.critic.penalty, .place = PenaltyPlace::kInterpolates},
          .optimizer = GanCriticOptimizer(config),
          .steps = config.StageSteps(critic == GanCritic::kSilhouettes),
          .seed = static_cast<std::uint64_t>(config.schedule.seed),
          .weights = kGanCriticStreams[which],
          .interpolates = kGanCriticStreams[which]};
}

}  // namespace tilegrad::train

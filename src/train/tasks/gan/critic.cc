// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/critic.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"
#include "train/losses/wgan_gp.h"
#include "train/tasks/gan/real_pictures.h"

namespace tilegrad::train {
namespace {

nn::Critic MakeCritic(nn::Context& context, const GanConfig& config, const CriticRole& role) {
  Rng rng(static_cast<std::uint64_t>(config.schedule.seed), role.stream);
  return {context,
          {.in = role.channels,
           .base = config.critic.base,
           .halvings = static_cast<int>(config.critic.halvings),
           .padding_mode = role.padding},
          rng};
}

// A critic's rate, and no average: critics predict nothing.
OptimizerConfig OptimizerOf(const GanConfig& config) {
  OptimizerConfig out = config.optimizer;
  out.learning_rate = config.critic.learning_rate, out.average = 0;
  return out;
}

}  // namespace

CriticRole SilhouetteRole(std::int64_t views) {
  return {.prefix = "critic_shape.",
          .adversarial = {"adversarial_shape", "Adversarial loss of silhouettes (− mean score)"},
          .distance = {"distance_shape", "Wasserstein estimate of the critic of silhouettes"},
          .penalty = {"penalty_shape", "Gradient penalty of the critic of silhouettes"},
          .gradient = {"gradient_shape", "Norm of the gradient of the critic of silhouettes"},
          .channels = views,
          .stream = 0x637368};
}

CriticRole PictureRole(std::int64_t views) {
  return {.prefix = "critic_picture.",
          .adversarial = {"adversarial_picture", "Adversarial loss of pictures (− mean score)"},
          .distance = {"distance_picture", "Wasserstein estimate of the critic of pictures"},
          .penalty = {"penalty_picture", "Gradient penalty of the critic of pictures"},
          .gradient = {"gradient_picture", "Norm of the gradient of the critic of pictures"},
          .channels = 3 * views,
          .stream = 0x637063};
}

CriticRole TextureRole(const GeneratorConfig& maps) {
  return {.prefix = "critic_texture.",
          .adversarial = {"adversarial_texture", "Adversarial loss of texture maps (− mean score)"},
          .distance = {"distance_texture", "Wasserstein estimate of the critic of texture maps"},
          .penalty = {"penalty_texture", "Gradient penalty of the critic of texture maps"},
          .gradient = {"gradient_texture", "Norm of the gradient of the critic of texture maps"},
          .channels = 3,
          .stream = 0x637478,
          .padding = maps.symmetric_texture ? nn::PadMode::kReplicate : nn::PadMode::kCircular};
}

GanCritic::GanCritic(nn::Context& context, const GanConfig& config, const CriticRole& role,
                     std::int64_t steps)
    : context_(context),
      role_(role),
      penalty_(config.critic.penalty),
      seed_(static_cast<std::uint64_t>(config.schedule.seed) ^ role.stream),
      critic_(MakeCritic(context, config, role)),
      weights_(context, critic_, OptimizerOf(config), steps) {}

void GanCritic::AddGeneratorLoss(double weight, const nn::Var& fake, LossSum* sum) {
  const auto& [name, label] = role_.adversarial;
  sum->Add(name, label, weight, WganGeneratorLoss(critic_, fake));
}

Result<nn::StepVector<nn::Gradient>> GanCritic::Gradients(const Pair& pair, const Backward& how) {
  Rng rng(seed_, how.number);
  const CriticLoss loss =
      WganCriticLoss(critic_, nn::Constant(context_, pair.real), nn::Constant(context_, pair.fake),
                     {.penalty = penalty_, .place = PenaltyPlace::kInterpolates}, rng);
  auto gradients = nn::Gradients(loss.total, weights_.adam().parameters(), how.listener);
  TILEGRAD_TRY(context_.TakeStatus());
  const double norm = nn::GlobalNorm(context_, gradients);
  if (!std::isfinite(loss.total.item()) || !std::isfinite(norm)) {
    return InternalError(
        "{}: the critic's loss is {}, its gradient's norm {}; a smaller critic.learning_rate or a "
        "larger critic.penalty may help",
        role_.distance.name, loss.total.item(), norm);
  }
  if (how.values == nullptr) return gradients;
  LossSum watched(how.values);
  watched.Watch(role_.distance.name, role_.distance.label, loss.wasserstein.item());
  if (penalty_ > 0) watched.Watch(role_.penalty.name, role_.penalty.label, loss.penalty.item());
  watched.Watch(role_.gradient.name, role_.gradient.label, norm);
  return gradients;
}

std::vector<nn::NamedTensor> GanCritic::State() {
  return WithPrefix(role_.prefix, weights_.State());
}

Status GanCritic::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t updates) {
  return weights_.LoadState(OfPrefix(role_.prefix, state), updates);
}

std::vector<nn::NamedTensor> WithPrefix(const std::string& prefix,
                                        std::vector<nn::NamedTensor> tensors) {
  for (nn::NamedTensor& tensor : tensors) tensor.name = prefix + tensor.name;
  return tensors;
}

std::vector<nn::NamedTensor> OfPrefix(const std::string& prefix,
                                      const std::vector<nn::NamedTensor>& tensors) {
  std::vector<nn::NamedTensor> out;
  for (const nn::NamedTensor& tensor : tensors) {
    if (tensor.name.starts_with(prefix))
      out.push_back({tensor.name.substr(prefix.size()), tensor.value});
  }
  return out;
}

}  // namespace tilegrad::train

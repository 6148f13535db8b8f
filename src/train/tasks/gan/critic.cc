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
  return {"critic_shape.", "adversarial_shape", "distance_shape",
          "penalty_shape", "gradient_shape",    views,
          0x637368};
}

CriticRole PictureRole(std::int64_t views) {
  return {"critic_picture.", "adversarial_picture", "distance_picture",
          "penalty_picture", "gradient_picture",    3 * views,
          0x637063};
}

CriticRole TextureRole(const GeneratorConfig& maps) {
  return {"critic_texture.",
          "adversarial_texture",
          "distance_texture",
          "penalty_texture",
          "gradient_texture",
          3,
          0x637478,
          maps.symmetric_texture ? nn::PadMode::kReplicate : nn::PadMode::kCircular};
}

GanCritic::GanCritic(nn::Context& context, const GanConfig& config, const CriticRole& role,
                     std::int64_t steps)
    : context_(context),
      role_(role),
      penalty_(config.critic.penalty),
      seed_(static_cast<std::uint64_t>(config.schedule.seed) ^ role.stream),
      critic_(MakeCritic(context, config, role)),
      weights_(context, critic_, OptimizerOf(config), steps) {}

nn::Var GanCritic::GeneratorLoss(const nn::Var& fake) { return WganGeneratorLoss(critic_, fake); }

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
        role_.distance, loss.total.item(), norm);
  }
  if (how.terms == nullptr) return gradients;
  how.terms->push_back({role_.distance, 0, loss.wasserstein.item()});
  if (penalty_ > 0) how.terms->push_back({role_.penalty, 0, loss.penalty.item()});
  how.terms->push_back({role_.gradient, 0, norm});
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

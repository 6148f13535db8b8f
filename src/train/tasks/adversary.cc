// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/adversary.h"

#include "base/error.h"
#include "nn/nn.h"
#include "train/data/fingerprint.h"
#include "train/tasks/classify/perceptual_network.h"

namespace tilegrad::train {
namespace {

constexpr CriticRole kAdversaryRole = {
    .prefix = "critic.",
    .keys = "adversarial",
    .adversarial = {"adversarial", "Adversarial loss (− mean score of rendered pictures)"},
    .distance = {"critic_distance", "Critic's margin between true and rendered pictures"},
    .penalty = {"critic_penalty", "Gradient penalty of the critic"}};
constexpr std::uint64_t kCriticWeightStream = 0x637269746963, kPenaltyStream = 0x70656e616c7479;

}  // namespace

ConfigFields FieldsOf(AdversaryConfig* c) {
  return {
      {"adversarial.weight", &c->weight, 0, kNoLimit, "weight of equation 15; 0.5 in the paper"},
      {"adversarial.features", &c->features, 0, kNoLimit,
       "weight of the difference in the critic's features"},
      {"adversarial.perceptual", &c->perceptual, 0, kNoLimit,
       "weight of the difference in a trained network's features; 1 in the paper"},
      {"adversarial.network", &c->network, 0, 0,
       "the network of the perceptual loss: \"classify\" or \"vgg16\""},
      {"adversarial.network_file", &c->network_file, 0, 0,
       "run folder of that network, or the safetensors file of its weights", Affects::kPlace},
      {"adversarial.penalty", &c->penalty, 0, kNoLimit, "weight of the gradient penalty"},
      {"adversarial.place", &c->place, 0, 0,
       "where the penalty is evaluated: at \"rendered\" pictures or at \"interpolates\""},
      {"adversarial.learning_rate", &c->learning_rate, 0, 1, "of the critic's Adam"},
      {"adversarial.beta1", &c->beta1, 0, 0.999999, "of the critic's Adam"},
      {"adversarial.beta2", &c->beta2, 0, 0.99999999, "of the critic's Adam"},
      {"adversarial.base", &c->base, 1, 4096, "the critic's channels at half size; they double"},
      {"adversarial.halvings", &c->halvings, 1, 8, "halvings of the critic"},
      {"adversarial.updates", &c->updates, 1, 100, "updates of the critic per step"},
  };
}

Adversary::Adversary(nn::Context& context, const AdversaryConfig& config, PenaltyPlace place,
                     const Schedule& schedule)
    : context_(context), config_(config), kept_(static_cast<std::size_t>(schedule.portions)) {
  if (!config.HasCritic()) return;
  const LearnedCritic::Job job{
      .role = kAdversaryRole,
      .shape = {.base = config.base, .halvings = static_cast<int>(config.halvings)},
      .game = {.penalty = config.penalty, .place = place},
      .optimizer = {.learning_rate = config.learning_rate,
                    .beta1 = config.beta1,
                    .beta2 = config.beta2},
      .seed = static_cast<std::uint64_t>(schedule.seed),
      .weights = kCriticWeightStream,
      .interpolates = kPenaltyStream};
  critic_.emplace(context, job);
}

Result<std::unique_ptr<Adversary>> Adversary::Make(nn::Context& context,
                                                   const AdversaryConfig& config,
                                                   const Schedule& schedule) {
  TILEGRAD_ASSIGN(const PenaltyPlace place, PenaltyPlaceOf(config.place));
  auto out = std::unique_ptr<Adversary>(new Adversary(context, config, place, schedule));
  if (config.perceptual == 0) return out;
  if (config.network_file.empty())
    return InvalidArgument(
        "adversarial.perceptual needs adversarial.network_file, e.g. the folder of a run of "
        "configs/classify.toml");
  auto network = LoadPerceptualNetwork(context, {config.network, config.network_file});
  if (!network.ok()) return network.status().Within("adversarial.network_file");
  out->perceptual_ = std::move(*network);
  return out;
}

void Adversary::AddLosses(const Pictures& pictures, LossSum* sum) {
  const auto& [rendered, truth, portion] = pictures;
  kept_[static_cast<std::size_t>(portion.index)] = {truth, rendered.value()};
  if (config_.weight > 0) critic_->AddGeneratorLoss(config_.weight, rendered, sum);
  if (config_.features > 0)
    sum->Add("critic_features", "Features of the critic (L1)", config_.features,
             FeatureL1Loss(FeaturesOf(critic_->network()), rendered, truth));
  if (config_.perceptual > 0)
    sum->Add("perceptual", "Features of a trained network (L1)", config_.perceptual,
             FeatureL1Loss(perceptual_, rendered, truth));
}

Result<nn::StepVector<nn::Gradient>> Adversary::CriticGradients(const CriticStep& at,
                                                                StepValues* values) {
  const Slots draw = SlotsOf(at.step * config_.updates + at.update, at.portion.count, at.portion);
  return critic_->Gradients(kept_[static_cast<std::size_t>(at.portion.index)],
                            static_cast<std::uint64_t>(draw.first), at.listener,
                            at.update == 0 ? values : nullptr);
}

std::vector<nn::NamedTensor> Adversary::State() {
  return critic_ ? critic_->State() : std::vector<nn::NamedTensor>();
}

Status Adversary::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) {
  return critic_ ? critic_->LoadState(state, steps * config_.updates) : Status();
}

std::vector<nn::NamedTensor> Adversary::Buffers() {
  return critic_ ? nn::Buffers(critic_->network()) : std::vector<nn::NamedTensor>();
}

Result<std::string> Adversary::Fingerprint(const std::string& data) const {
  if (config_.perceptual == 0) return data;
  TILEGRAD_ASSIGN(const Path weights,
                  PerceptualWeights(context_, {config_.network, config_.network_file}));
  return WithFile(data, weights);
}

}  // namespace tilegrad::train

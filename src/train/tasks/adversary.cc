// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/adversary.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"
#include "train/data/fingerprint.h"
#include "train/tasks/classify/perceptual_network.h"

namespace tilegrad::train {
namespace {

const std::string kCriticPrefix = "critic.";
constexpr std::uint64_t kCriticWeightStream = 0x637269746963, kPenaltyStream = 0x70656e616c7479;

}  // namespace

ConfigFields FieldsOf(AdversaryConfig* c) {
  return {
      {"adversarial.weight", &c->weight, 0, kNoLimit, "of equation 15; 0.5 in the paper"},
      {"adversarial.features", &c->features, 0, kNoLimit,
       "weight of the difference of the critic's features"},
      {"adversarial.perceptual", &c->perceptual, 0, kNoLimit,
       "weight of the difference of a trained network's features; 1 in the paper"},
      {"adversarial.network", &c->network, 0, 0, "that network: \"classify\" or \"vgg16\""},
      {"adversarial.network_file", &c->network_file, 0, 0,
       "its run folder, or the safetensors file of its weights"},
      {"adversarial.penalty", &c->penalty, 0, kNoLimit, "weight of the gradient penalty"},
      {"adversarial.place", &c->place, 0, 0,
       "of the penalty: at \"rendered\" pictures or at \"interpolates\""},
      {"adversarial.learning_rate", &c->learning_rate, 0, 1, "of the critic's Adam"},
      {"adversarial.beta1", &c->beta1, 0, 0.999999, "of the critic's Adam"},
      {"adversarial.beta2", &c->beta2, 0, 0.99999999, "of the critic's Adam"},
      {"adversarial.base", &c->base, 1, 4096, "the critic's channels at half size; they double"},
      {"adversarial.halvings", &c->halvings, 1, 8, "of the critic"},
      {"adversarial.updates", &c->updates, 1, 100, "of the critic in each step"},
  };
}

Adversary::Adversary(nn::Context& context, const AdversaryConfig& config, std::uint64_t seed)
    : context_(context), config_(config), seed_(seed) {
  if (!config.HasCritic()) return;
  Rng rng(seed, kCriticWeightStream);
  critic_.emplace(
      context, nn::CriticShape{.base = config.base, .halvings = static_cast<int>(config.halvings)},
      rng);
  adam_.emplace(
      context, nn::Parameters(*critic_),
      nn::AdamOptions{
          .learning_rate = config.learning_rate, .beta1 = config.beta1, .beta2 = config.beta2});
}

Result<std::unique_ptr<Adversary>> Adversary::Make(nn::Context& context,
                                                   const AdversaryConfig& config,
                                                   std::uint64_t seed) {
  TILEGRAD_ASSIGN(const PenaltyPlace place, PenaltyPlaceOf(config.place));
  auto out = std::unique_ptr<Adversary>(new Adversary(context, config, seed));
  out->place_ = place;
  if (config.perceptual == 0) return out;
  if (config.network_file.empty()) {
    return InvalidArgument(
        "adversarial.perceptual needs adversarial.network_file, e.g. the folder of a run of "
        "configs/classify.toml");
  }
  TILEGRAD_ASSIGN(out->perceptual_,
                  LoadPerceptualNetwork(context, {config.network, config.network_file}));
  return out;
}

void Adversary::AddLosses(const Pictures& pictures, LossSum* sum) {
  const auto& [rendered, truth, portion] = pictures;
  kept_.resize(static_cast<std::size_t>(portion.count));
  kept_[static_cast<std::size_t>(portion.index)] = {rendered.value(), truth};
  if (config_.weight > 0) {
    sum->Add("adversarial", "Adversarial loss (− mean score of rendered pictures)", config_.weight,
             WganGeneratorLoss(*critic_, rendered));
  }
  if (config_.features > 0) {
    sum->Add("critic_features", "Features of the critic (L1)", config_.features,
             FeatureL1Loss(FeaturesOf(*critic_), rendered, truth));
  }
  if (config_.perceptual > 0) {
    sum->Add("perceptual", "Features of a trained network (L1)", config_.perceptual,
             FeatureL1Loss(perceptual_, rendered, truth));
  }
}

Result<nn::StepVector<nn::Gradient>> Adversary::CriticGradients(const CriticStep& at,
                                                                StepValues* values) {
  const Slots draw = SlotsOf(at.step * config_.updates + at.update, at.portion.count, at.portion);
  Rng rng(seed_ ^ kPenaltyStream, static_cast<std::uint64_t>(draw.first));
  const auto& [rendered, truth] = kept_[static_cast<std::size_t>(at.portion.index)];
  const CriticLoss loss =
      WganCriticLoss(*critic_, nn::Constant(context_, truth), nn::Constant(context_, rendered),
                     {.penalty = config_.penalty, .place = place_}, rng);
  auto gradients = nn::Gradients(loss.total, adam_->parameters(), at.listener);
  TILEGRAD_TRY(context_.TakeStatus());
  if (!std::isfinite(loss.total.item()) || !nn::IsFinite(context_, gradients)) {
    return InternalError(
        "the critic's loss is {}; a smaller adversarial.learning_rate or a larger "
        "adversarial.penalty may help",
        loss.total.item());
  }
  if (at.update > 0) return gradients;
  LossSum watched(values);
  watched.Watch("critic_distance", "How far the critic tells true from rendered pictures",
                loss.wasserstein.item());
  if (config_.penalty > 0)
    watched.Watch("critic_penalty", "Gradient penalty of the critic", loss.penalty.item());
  return gradients;
}

std::vector<nn::NamedTensor> Adversary::State() {
  if (!critic_) return {};
  std::vector<nn::NamedTensor> out = nn::State(*critic_);
  for (const nn::NamedTensor& moment : adam_->State()) out.push_back(moment);
  for (nn::NamedTensor& tensor : out) tensor.name = kCriticPrefix + tensor.name;
  return out;
}

Status Adversary::LoadState(const std::vector<nn::NamedTensor>& state) {
  if (!critic_) return {};
  std::vector<nn::NamedTensor> own;
  for (const nn::NamedTensor& tensor : state) {
    if (tensor.name.starts_with(kCriticPrefix))
      own.push_back({tensor.name.substr(kCriticPrefix.size()), tensor.value});
  }
  TILEGRAD_TRY(nn::LoadState(*critic_, own));
  return adam_->LoadState(own);
}

std::vector<nn::NamedTensor> Adversary::Buffers() {
  return critic_ ? nn::Buffers(*critic_) : std::vector<nn::NamedTensor>();
}

Result<std::string> Adversary::Fingerprint(const std::string& data) const {
  if (config_.perceptual == 0) return data;
  TILEGRAD_ASSIGN(const Path weights,
                  PerceptualWeights(context_, {config_.network, config_.network_file}));
  return WithFile(data, weights);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/network_task.h"

#include "base/error.h"
#include "nn/nn.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train {

Status NetworkTask::BeginStart(const TaskStart& start, std::int64_t batch) {
  context_ = &start.context;
  lesson_.batch = batch;
  return CheckPortions(batch, start.schedule.portions);
}

Status NetworkTask::StartAs(const Path& run) {
  const std::string place = "start.run = \"" + run.string() + "\"";
  const auto found = FindCheckpoint(*context_, run);
  if (!found.ok()) return found.status().Within(place);
  return LoadPredictingWeights(weights().network(), found->checkpoint.tensors).Within(place);
}

RunHeader NetworkTask::Header() {
  return {.dataset_source = lesson_.source,
          .training_models = lesson_.objects,
          .parameters = nn::CountParameters(weights().network())};
}

Result<std::string> NetworkTask::Fingerprint(const Path& data, const Workers& workers) const {
  TILEGRAD_ASSIGN(const std::string own, Task::Fingerprint(data, workers));
  return adversary_ ? adversary_->Fingerprint(own) : own;
}

Result<nn::StepVector<nn::Gradient>> NetworkTask::Backward(const UpdateIndex& at, StepValues* out) {
  if (at.update > 0)
    return adversary_->CriticGradients({at.step, at.update - 1, at.portion, at.listener}, out);
  TILEGRAD_ASSIGN(const nn::Var loss, Loss(at, SlotsOf(at.step, lesson_.batch, at.portion), out));
  TILEGRAD_ASSIGN(auto gradients, weights().Gradients(loss, at.listener, *out));
  const auto seen = static_cast<double>((at.step + 1) * lesson_.batch);
  out->also.emplace_back("epoch", seen / lesson_.objects);
  out->also.emplace_back("learning_rate", weights().RateAt(at.step));
  return gradients;
}

Status NetworkTask::Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) {
  return at.update == 0 ? weights().Update(gradients, at.step, at.share)
                        : adversary_->UpdateCritic(gradients, at.share);
}

Result<std::vector<nn::NamedTensor>> NetworkTask::Statistics() {
  std::vector<nn::NamedTensor> out = nn::Buffers(weights().network());
  if (adversary_) Append(adversary_->Buffers(), &out);
  return out;
}

std::vector<nn::NamedTensor> NetworkTask::State() {
  std::vector<nn::NamedTensor> out = weights().State();
  if (adversary_) Append(adversary_->State(), &out);
  return out;
}

Status NetworkTask::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) {
  TILEGRAD_TRY(weights().LoadState(state, steps));
  return adversary_ ? adversary_->LoadState(state, steps) : Status();
}

Result<Dataset> OpenTrainingData(const TaskStart& start) {
  TILEGRAD_ASSIGN(Dataset dataset, Dataset::Open(start.data));
  if (!dataset.Select(Split::kTrain).empty()) return dataset;
  return InvalidArgument("{}: no training models in it", dataset.folder().string());
}

}  // namespace tilegrad::train

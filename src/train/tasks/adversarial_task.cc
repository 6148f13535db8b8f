// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/adversarial_task.h"

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

void Append(std::vector<nn::NamedTensor> more, std::vector<nn::NamedTensor>* all) {
  for (nn::NamedTensor& tensor : more) all->push_back(std::move(tensor));
}

}  // namespace

Status AdversarialTask::Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) {
  return at.update == 0 ? weights().Update(gradients, at.step, at.share)
                        : adversary_->UpdateCritic(gradients, at.share);
}

Result<std::vector<nn::NamedTensor>> AdversarialTask::Statistics() {
  std::vector<nn::NamedTensor> out = nn::Buffers(network());
  Append(adversary_->Buffers(), &out);
  return out;
}

std::vector<nn::NamedTensor> AdversarialTask::State() {
  std::vector<nn::NamedTensor> out = weights().State();
  Append(adversary_->State(), &out);
  return out;
}

Status AdversarialTask::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) {
  TILEGRAD_TRY(weights().LoadState(state, steps));
  return adversary_->LoadState(state);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/task.h"

#include "base/error.h"
#include "nn/nn.h"
#include "train/data/fingerprint.h"
#include "train/tasks/network_task.h"

namespace tilegrad::train {

Status Model::LoadWeights(nn::Module& network, const std::vector<nn::NamedTensor>& state) {
  parameters_ = nn::CountParameters(network);
  weights_ = nn::State(network);
  return LoadPredictingWeights(network, state);
}

Status Model::SetTemplate(const Mesh& start, double half_extent) {
  template_ = start;
  return NormalizeToBox(template_, static_cast<float>(half_extent));
}

Result<std::string> Task::Fingerprint(const Path& data, const Workers& workers) const {
  return DataFingerprint(data, workers);
}

Result<std::vector<nn::NamedTensor>> Task::Statistics() {
  return InvalidArgument("schedule.portions must be 1: this task cannot split a batch");
}

Status Model::Predict(std::span<const std::uint8_t> /*images*/, std::vector<Mesh>* /*meshes*/) {
  return InvalidArgument("this network predicts no meshes; train one with --config quick");
}

}  // namespace tilegrad::train

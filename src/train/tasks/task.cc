// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/task.h"

#include "base/error.h"
#include "train/data/fingerprint.h"

namespace tilegrad::train {

const Mesh& Model::template_mesh() const {
  static const Mesh none;
  return none;
}

Result<std::string> Task::Fingerprint(const Path& data, const Workers& workers) const {
  return DataFingerprint(data, workers);
}

Result<std::vector<nn::NamedTensor>> Task::Statistics() {
  return InvalidArgument(
      "schedule.portions must be 1: this task knows nothing of portions of a batch");
}

Status Model::Predict(std::span<const std::uint8_t> /*images*/, std::vector<Mesh>* /*meshes*/) {
  return InvalidArgument("this network predicts no meshes; train one with --config quick");
}

}  // namespace tilegrad::train

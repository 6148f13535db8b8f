// SPDX-License-Identifier: Apache-2.0
// A trained classifier.
#pragma once

#include "train/models/classifier.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// What checkpoints keep beside the weights: the classes, by number.
nn::NamedTensor ClassNames(nn::Context& context, const std::vector<std::string>& classes);
// An error if there are none, or fewer than two.
Result<std::vector<std::string>> ReadClassNames(const std::vector<nn::NamedTensor>& state);

class ClassifierModel : public Model {
 public:
  static Result<std::unique_ptr<ClassifierModel>> Load(nn::Context& context,
                                                       const ClassifierConfig& config,
                                                       const Checkpoint& checkpoint);

  ClassifierModel* classifier() override { return this; }
  ClassifierNetwork& network() { return network_; }
  const std::vector<std::string>& classes() const { return classes_; }
  // The most likely class of each picture; of equals the first. images: [n][4][size][size] planar
  // RGBA bytes, RGB over black, n at most kImagesAtOnce.
  Result<std::vector<int>> Classify(std::span<const std::uint8_t> images);

 private:
  ClassifierModel(nn::Context& context, const ClassifierConfig& config,
                  std::vector<std::string> classes, int image_size);
  nn::Context& context_;
  std::vector<std::string> classes_;
  int image_size_;
  ClassifierNetwork network_;
};

// Of each row of scores [n, classes].
std::vector<int> MostLikely(const nn::Tensor& scores);

}  // namespace tilegrad::train

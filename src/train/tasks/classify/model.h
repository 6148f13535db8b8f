// SPDX-License-Identifier: Apache-2.0
// A trained classifier.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "train/data/batches.h"
#include "train/models/classifier.h"
#include "train/tasks/next_batch.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// The class names by index, kept in checkpoints beside the weights.
nn::NamedTensor ClassNames(nn::Context& context, const std::vector<std::string>& classes);
// An error if they are missing or fewer than two.
Result<std::vector<std::string>> ReadClassNames(const std::vector<nn::NamedTensor>& state);

class ClassifierModel : public Model {
 public:
  static Result<std::unique_ptr<ClassifierModel>> Load(nn::Context& context,
                                                       const ClassifierConfig& config,
                                                       const Checkpoint& checkpoint);

  ClassifierModel* classifier() override { return this; }
  ClassifierNetwork& network() { return network_; }
  const std::vector<std::string>& classes() const { return classes_; }
  // The most likely class of each picture; the first of ties. images: [n][4][size][size] planar
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

// Argmax of each row of scores [n, classes]; the first of ties.
std::vector<int> MostLikely(const nn::Tensor& scores);

// Scores and report pictures of a classifier on held-out models.

// Accuracy, with two baselines: always the most frequent class, and the class of the nearest
// training picture. Errors: as CheckHeldOut; images of another size or other classes than it was
// trained on; an empty split; a job with a change, since there are no meshes.
Result<Evaluation> EvaluateClassifier(const TaskEvaluation& job, ClassifierModel& model,
                                      const Workers& workers, const Watch& watch);

// Showcase of the test split: three views of each model and their predicted classes.
Result<Showcase> ShowClassified(const ShowcaseRequest& request, ClassifierModel& model,
                                const Watch& watch);

// Pictures of a dataset with their classes, as tensors.

struct LabelledImages {
  ImageStore images;
  std::vector<std::int32_t> labels;  // of each model: ModelInfo::class_index
};

Result<LabelledImages> LoadLabelled(const Dataset& dataset, const std::vector<int>& models,
                                    const Workers& workers, const Watch& watch);

// Augmentation by translation, in pixels to the right and down; black fills in.
struct Shift {
  int x = 0, y = 0;
};
// At most `most` pixels each way; a pure function of seed and position.
Shift RandomShift(std::uint64_t seed, std::uint64_t position, int most);

struct LabelledBatch {
  nn::Tensor images;  // [n, 3, size, size], RGB over black in [0, 1]
  nn::Tensor labels;  // [n] of kI32
};
// The first view of each sample; one shift for each, or none at all. `data` outlives the work.
BatchWork<LabelledBatch> LabelledWork(nn::Context& context, const LabelledImages& data,
                                      std::vector<Sample> batch, std::vector<Shift> shifts);
// The same, on all workers.
LabelledBatch GatherLabelled(nn::Context& context, const LabelledImages& data,
                             std::span<const Sample> batch, std::span<const Shift> shifts = {});

// images: [n][4][size][size] planar RGBA bytes, RGB over black.
nn::Tensor ColorsOf(nn::Context& context, std::span<const std::uint8_t> images, int size);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Evaluates a predictor on held-out models: the paper's Table 1 with three baselines (section 5.1).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"
#include "train/eval/evaluation.h"
#include "train/eval/scores.h"
#include "train/ranks/process_group.h"

namespace tilegrad::train {

// Images [N][4][size][size] to N meshes, as Predictor::Predict. Called from one thread at a time.
using PredictFunction = std::function<Result<std::vector<Mesh>>(std::span<const std::uint8_t>)>;

// All views of a model to a mesh. Called from one thread at a time.
using FitFunction = std::function<Result<Mesh>(const ModelData&)>;

struct EvaluationJob {
  const Dataset* dataset = nullptr;
  Split split = Split::kTest;
  PredictFunction predict;
  FitFunction oracle{};      // the row "oracle"; none: no such row
  Mesh template_mesh;        // the baseline "undeformed template"
  int views_per_model = 24;  // evenly spread over the dataset's views; at most all of them
  // Training models, spread evenly, whose pictures are searched for the nearest to each input: some
  // milliseconds a search, 200 MB. No such baseline: 0, or where training models are scored.
  int retrieval_models = 1000;
  VoxelJob voxels{};      // with the half-extent of predictions
  std::string predictor;  // Predictor::description, for the heading
  ProcessGroup* group =
      nullptr;  // the ranks that score models together; only rank 0 gets complete scores
};

// One score for each model and view, averaged over the views, then over the models of a shape
// (ShapeOf), over the shapes of a class, and over classes. Same bits for any worker count. Errors:
// no model in the split or none to train on, a model file that cannot be read, a failed prediction;
// kCancelled when `stop` is set.
Result<Evaluation> Evaluate(const EvaluationJob& job, const Workers& workers, const Watch& watch);

}  // namespace tilegrad::train

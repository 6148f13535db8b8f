// SPDX-License-Identifier: Apache-2.0
// How good a predictor is on models that it never saw: the paper's Table 1 with two baselines
// (section 5.1).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// Images [N][4][size][size] to N meshes, as Predictor::Predict. Called from one thread at a time.
using PredictFunction = std::function<Result<std::vector<Mesh>>(std::span<const std::uint8_t>)>;

inline constexpr double kFScoreThreshold = 0.02;  // world units, longest side 0.9

struct EvaluationJob {
  const Dataset* dataset = nullptr;
  Split split = Split::kTest;
  PredictFunction predict;
  Mesh template_mesh;        // the baseline "undeformed template"
  int views_per_model = 24;  // evenly spread over the dataset's views; at most all of them
  std::string predictor;     // Predictor::description, for the heading
};

struct Score {
  double iou = 0;                 // 3D IoU at 32^3, in [0, 1]
  std::optional<double> f_score;  // at kFScoreThreshold, in [0, 1]; none: the truth has no mesh
};

struct EvaluationRow {
  std::string method;
  std::vector<Score> classes;  // as Evaluation::classes
  Score mean;                  // of the class means
};

struct ModelScore {
  int model = 0;  // index into Dataset::models()
  Score score;    // mean over its views
};

struct Evaluation {
  std::string predictor, split;
  int views_per_model = 0;
  std::vector<std::string> classes;  // those that have models in the split
  std::vector<int> class_models;     // how many
  std::vector<EvaluationRow> rows;   // template, best single shape, prediction
  std::vector<ModelScore> models;    // of the prediction, in the dataset's order
  double shape_threshold = 0;    // share of training models above which the single shape is solid
  int unusable_predictions = 0;  // without extent or area: they score 0
};

// One score for each model and view, mean over the views, then over the models of a class, then
// over classes. Same bits for any worker count. Errors: no model in the split or none to train on,
// a model file that cannot be read, a failed prediction; kCancelled when `stop` is set.
Result<Evaluation> Evaluate(const EvaluationJob& job, const Workers& workers,
                            const ProgressSink& progress, const StopFlag& stop);

// The table with methods as rows and classes as columns, each cell "IoU / F-score" in percent.
std::string FormatTable(const Evaluation& evaluation);
std::string FormatMarkdown(const Evaluation& evaluation);
// <run>/eval.json and <run>/eval.md, each whole or not at all.
Status WriteEvaluation(const Path& run, const Evaluation& evaluation, const Dataset& dataset);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Scores of a prediction and of baselines, by method and class, and by model. Written by `tilegrad
// eval`, read by reports.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

// For tasks that predict light: the row with one light for all pictures.
inline constexpr const char* kMeanLightRow = "mean light";

// The voxelization rule of an IoU: ours (Voxelize), binvox's as the paper ran it (VoxelizeCarved),
// or N3MR's (VoxelizeNmr).
enum class VoxelRule { kOurs, kBinvox, kNmr };
inline constexpr const char* kVoxelRuleNames[] = {"ours", "binvox", "nmr"};

inline constexpr double kFScoreThreshold = 0.02;  // world units, longest side 0.9

struct Score {
  // The score that compares methods, in [0, 1]; higher is better.
  double main() const {
    if (pck) return *pck;
    if (mask_loss) return 1 - *mask_loss;
    return accuracy.value_or(iou);
  }

  double iou = 0;                 // 3D IoU at 32^3, in [0, 1]; Evaluation::voxels
  std::optional<double> f_score;  // at kFScoreThreshold, in [0, 1]; none: the truth has no mesh
  // Share of pictures classified correctly, for tasks that classify; `iou` is meaningless then.
  std::optional<double> accuracy = std::nullopt;
  // As iou, with voxels of VoxelizeCarved: the paper's rule; none: the truth has no mesh.
  std::optional<double> carved_iou = std::nullopt;
  // Mean |difference| of colour, [0, 1], over the channels and the pixels that the object or its
  // prediction covers, black beyond them, in views of the dataset; none for a shape without
  // colours.
  std::optional<double> color_l1 = std::nullopt;
  // The same over pixels of which both cover half or more, between the colours of what covers them:
  // the quality of the paint, whatever the outline (1: no such pixel). Then this over the faces of
  // a prediction that its input picture shows, and over its other faces.
  std::optional<double> shared_color_l1 = std::nullopt, seen_color_l1 = std::nullopt,
                        hidden_color_l1 = std::nullopt;
  // Table 2 of the paper, of tasks that predict texture and light. Mean |difference| over all
  // pixels of the image, black beyond the object, and the channels, [0, 1]: of renders without
  // light, and with the predicted light against the true one; and the angle between the lights'
  // directions in degrees.
  std::optional<double> texture_l1 = std::nullopt, lit_l1 = std::nullopt,
                        light_angle = std::nullopt;
  // Table 3, of tasks that learn from photographs, with texture_l1: 1 - IoU of silhouettes, and the
  // share of visible keypoints that are correct (metrics/metrics.h). `iou` is meaningless then.
  std::optional<double> mask_loss = std::nullopt, pck = std::nullopt;
};

struct EvaluationRow {
  std::string method;
  std::vector<Score> classes;                 // as Evaluation::classes
  Score mean;                                 // of the class means
  std::optional<Score> error = std::nullopt;  // standard errors of `mean` (statistics.h)
};

struct ModelScore {
  std::string class_name, id;  // as the dataset has them
  Score score;                 // mean over its views
  std::string shape = {};      // as ModelInfo::shape
};
// As ShapeOf(ModelInfo).
inline const std::string& ShapeOf(const ModelScore& model) {
  return model.shape.empty() ? model.id : model.shape;
}

struct Evaluation {
  std::string predictor, split;
  std::string dataset_source;
  std::string voxels = "ours";  // kVoxelRuleNames: of Score::iou
  int views_per_model = 0;
  std::vector<std::string> classes;  // those that have models in the split
  std::vector<int> class_models;     // how many
  std::vector<EvaluationRow> rows;   // baselines, and last the prediction
  std::vector<ModelScore> models;    // of the prediction
  double shape_threshold = 0;  // share of training models above which the single shape is solid;
                               // 0: no such row
  int retrieval_models =
      0;  // whose pictures the row "nearest training picture" chose from; 0: no such row
  int unusable_predictions = 0;  // without extent or area: they score 0
};

// Whether its scores are accuracies.
bool Classifies(const Evaluation& evaluation);
// Whether they are of photographs.
bool IsOfPhotographs(const Evaluation& evaluation);
// "photograph" or "model".
const char* ScoredThing(const Evaluation& evaluation);
// Score::main in words: "3D IoU", "accuracy", "keypoints within 0.1" or "2D IoU".
const char* MainMeasure(const Evaluation& evaluation);
// The table with methods as rows and classes as columns, each cell "IoU / F-score", or the
// accuracy, in percent; means with their standard errors.
std::string FormatTable(const Evaluation& evaluation);
std::string FormatMarkdown(const Evaluation& evaluation);
// The contents of <run>/eval.json.
nlohmann::ordered_json EvaluationJson(const Evaluation& evaluation);
// How the files of scores on the run's own dataset begin; on others: kOwnScores + "_on_NAME".
inline constexpr const char* kOwnScores = "eval";
// <run>/NAME.json and <run>/NAME.md, each whole or not at all.
Status WriteEvaluation(const Path& run, const Evaluation& evaluation,
                       const std::string& name = kOwnScores);
// What WriteEvaluation wrote; nullopt without <run>/NAME.json.
Result<std::optional<Evaluation>> ReadEvaluation(const Path& run,
                                                 const std::string& name = kOwnScores);

}  // namespace tilegrad::train

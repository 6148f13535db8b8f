// SPDX-License-Identifier: Apache-2.0
// eval.json back into an Evaluation.
#include <limits>

#include "base/file.h"
#include "train/eval/evaluation.h"
#include "train/eval/measures.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using ParsedJson = nlohmann::json;

Result<const ParsedJson*> Array(const ParsedJson& json, const char* key, const std::string& place) {
  if (json.is_object() && json.contains(key) && json[key].is_array()) return &json[key];
  return DataLoss("{}: \"{}\" must be an array", place, key);
}

Result<Score> ReadScore(const ParsedJson& json, const std::string& place) {
  Score score;
  JsonFields fields(json, place);
  for (const ScoreMeasure& measure : kMeasures) {
    if (measure.value && json.is_object() && json.contains(measure.key) &&
        !json[measure.key].is_null())
      fields.Read(measure.key, &(score.*measure.value).emplace());
  }
  if (!score.accuracy) fields.Read("iou", &score.iou);
  if (!fields.status().ok()) return fields.status();
  return score;
}

Result<EvaluationRow> ReadRow(const ParsedJson& json, std::size_t classes,
                              const std::string& place) {
  EvaluationRow row;
  JsonFields fields(json, place);
  fields.Read("method", &row.method);
  if (!fields.status().ok()) return fields.status();
  TILEGRAD_ASSIGN(const ParsedJson* scores, Array(json, "classes", place));
  if (scores->size() != classes)
    return DataLoss("{}: {} scores for {} classes", place, scores->size(), classes);
  for (const ParsedJson& item : *scores) {
    TILEGRAD_ASSIGN(const Score score, ReadScore(item, place));
    row.classes.push_back(score);
  }
  TILEGRAD_ASSIGN(row.mean, ReadScore(json.value("mean", ParsedJson()), place + ": \"mean\""));
  if (!json.contains("error")) return row;  // not in those of earlier versions, or unknown
  TILEGRAD_ASSIGN(row.error, ReadScore(json["error"], place + ": \"error\""));
  return row;
}

Status ReadRows(const ParsedJson& json, const std::string& place, Evaluation* out) {
  TILEGRAD_ASSIGN(const ParsedJson* rows, Array(json, "rows", place));
  for (const ParsedJson& item : *rows) {
    TILEGRAD_ASSIGN(EvaluationRow row,
                    ReadRow(item, out->classes.size(), place + ": an entry of \"rows\""));
    out->rows.push_back(std::move(row));
  }
  if (out->rows.empty()) return DataLoss("{}: \"rows\" is empty", place);
  return {};
}

Status ReadClassModels(const ParsedJson& json, const std::string& place, Evaluation* out) {
  TILEGRAD_ASSIGN(const ParsedJson* counts, Array(json, "class_models", place));
  for (const ParsedJson& count : *counts) {
    const bool whole = count.is_number_unsigned();
    if (!whole || count.get<std::uint64_t>() > std::numeric_limits<int>::max())
      return DataLoss("{}: \"class_models\" must hold whole numbers from 0 on", place);
    out->class_models.push_back(count);
  }
  if (out->class_models.size() == out->classes.size()) return {};
  return DataLoss("{}: \"class_models\" and \"classes\" differ in length", place);
}

Status ReadModelScores(const ParsedJson& json, const std::string& place, Evaluation* out) {
  TILEGRAD_ASSIGN(const ParsedJson* models, Array(json, "models", place));
  for (const ParsedJson& item : *models) {
    const std::string entry = place + ": an entry of \"models\"";
    ModelScore& model = out->models.emplace_back();
    TILEGRAD_ASSIGN(model.score, ReadScore(item, entry));
    JsonFields fields(item, entry);
    fields.Read("class", &model.class_name);
    fields.Read("id", &model.id);
    if (item.is_object() && item.contains("shape")) fields.Read("shape", &model.shape);
    if (!fields.status().ok()) return fields.status();
  }
  return {};
}

}  // namespace

Result<std::optional<Evaluation>> ReadEvaluation(const Path& run) {
  const Path file = run / "eval.json";
  if (!PathExists(file)) return std::optional<Evaluation>();
  const std::string place = file.string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  TILEGRAD_ASSIGN(const ParsedJson json, ParseJson(text, place));
  Evaluation out;
  JsonFields fields(json, place);
  const int most = std::numeric_limits<int>::max();
  fields.Read("predictor", &out.predictor);
  fields.Read("split", &out.split);
  fields.Read("views_per_model", 1, most, &out.views_per_model);
  fields.Read("shape_threshold", &out.shape_threshold);
  if (json.is_object() && json.contains("retrieval_models"))  // not in those of elder programs
    fields.Read("retrieval_models", 0, most, &out.retrieval_models);
  if (json.is_object() && json.contains("voxels")) fields.Read("voxels", &out.voxels);
  fields.Read("unusable_predictions", 0, most, &out.unusable_predictions);
  fields.Read("classes", &out.classes);
  if (!fields.status().ok()) return fields.status();
  TILEGRAD_TRY(ReadClassModels(json, place, &out));
  TILEGRAD_TRY(ReadRows(json, place, &out));
  TILEGRAD_TRY(ReadModelScores(json, place, &out));
  return std::optional(std::move(out));
}

}  // namespace tilegrad::train

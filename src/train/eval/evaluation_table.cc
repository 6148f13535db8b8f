// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/text.h"
#include "train/eval/evaluation.h"
#include "train/eval/scores.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

// "50.1", "50.1 ± 1.2", or "-".
std::string NumberText(const ScoreMeasure& measure, const Score& score,
                       const std::optional<Score>& error) {
  const auto value = measure.Of(score), off = error ? measure.Of(*error) : std::nullopt;
  if (!value) return "-";
  const std::string number = fmt::format("{:.{}f}", measure.factor * *value, measure.digits);
  if (!off) return number;
  return fmt::format("{} ± {:.{}f}", number, measure.factor * *off, measure.digits);
}

// `error`: standard errors, if they are to be told.
std::string Cell(const Score& score, const std::optional<Score>& error = std::nullopt) {
  const auto number = [&](const char* key) { return NumberText(MeasureOf(key), score, error); };
  if (score.accuracy) return number("accuracy");
  if (score.mask_loss || score.pck) return fmt::format("{:.1f}", 100 * score.main());
  return number("iou") + " / " + number("f_score");
}

bool HasAny(const Evaluation& evaluation, std::optional<double> Score::*measure) {
  return std::any_of(evaluation.rows.begin(), evaluation.rows.end(),
                     [&](const EvaluationRow& row) { return (row.mean.*measure).has_value(); });
}

// Measures with their own columns, of means over classes.
std::vector<const ScoreMeasure*> ColumnsOf(const Evaluation& evaluation) {
  std::vector<const ScoreMeasure*> out;
  for (const ScoreMeasure& measure : kMeasures) {
    if (measure.column && HasAny(evaluation, measure.value)) out.push_back(&measure);
  }
  return out;
}

// The error of a row's light over that of a constant one.
std::optional<double> LightOfConstant(const Evaluation& evaluation, const EvaluationRow& row) {
  for (const EvaluationRow& constant : evaluation.rows) {
    const auto of_constant = constant.mean.light_angle, own = row.mean.light_angle;
    if (constant.method == kMeanLightRow && own && of_constant) return *own / *of_constant;
  }
  return std::nullopt;
}

// Heading, then a line a method: the cells of the table as text.
std::vector<std::vector<std::string>> Cells(const Evaluation& evaluation) {
  std::vector<std::vector<std::string>> cells = {{"method"}};
  for (const auto& name : evaluation.classes) cells[0].push_back(name);
  cells[0].push_back("mean");
  const std::vector<const ScoreMeasure*> columns = ColumnsOf(evaluation);
  for (const ScoreMeasure* column : columns) cells[0].emplace_back(column->heading);
  const bool constant = LightOfConstant(evaluation, evaluation.rows.back()).has_value();
  if (constant) cells[0].emplace_back("light / constant");
  for (const auto& row : evaluation.rows) {
    auto& line = cells.emplace_back(1, row.method);
    for (const auto& score : row.classes) line.push_back(Cell(score));
    line.push_back(Cell(row.mean, row.error));
    for (const ScoreMeasure* column : columns)
      line.push_back(NumberText(*column, row.mean, row.error));
    if (!constant) continue;
    const auto ratio = LightOfConstant(evaluation, row);
    line.push_back(ratio ? fmt::format("{:.2f}", *ratio) : "-");
  }
  return cells;
}

std::vector<std::size_t> Widths(const std::vector<std::vector<std::string>>& cells) {
  std::vector<std::size_t> widths(cells[0].size(), 0);
  for (const auto& line : cells) {
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], line[i].size());
  }
  return widths;
}

// Methods to the left, numbers to the right.
std::string Join(const std::vector<std::string>& line, const std::vector<std::size_t>& widths,
                 const std::string& between) {
  std::string out = fmt::format("{:<{}}", line[0], widths[0]);
  for (std::size_t i = 1; i < line.size(); ++i)
    out += fmt::format("{}{:>{}}", between, line[i], widths[i]);
  return out;
}

std::string Caption(const Evaluation& evaluation) {
  int models = 0;
  for (const int n : evaluation.class_models) models += n;
  const std::string things = Count(models, ScoredThing(evaluation));
  if (IsOfPhotographs(evaluation))
    return fmt::format("{} (%) on {} of the {} split", MainMeasure(evaluation), things,
                       evaluation.split);
  const std::string measures =
      Classifies(evaluation)
          ? "Accuracy (%)"
          : fmt::format("3D IoU at 32^3 (%) / F-score at {} (%)", kFScoreThreshold);
  return fmt::format("{} on {} of the {} split, {} each", measures, things, evaluation.split,
                     Count(evaluation.views_per_model, "view"));
}

std::string ClassifierNotes(const Evaluation& evaluation) {
  std::string notes = "Most frequent class: always that of most training pictures.";
  if (evaluation.retrieval_models > 0)
    notes += fmt::format(
        " Nearest training picture: the class of that of {} training models which has the picture "
        "most like the input.",
        evaluation.retrieval_models);
  return notes;
}

constexpr const char* kPhotographNotes =
    "Table 3: texture L1 is the mean difference of colour between prediction and object over all "
    "pixels of the crop, black beyond them; 2D IoU loss is 1 - IoU of their silhouettes; PCK@0.1 "
    "is the share of visible keypoints within a tenth of the box's longer side, a mean over "
    "keypoints. All but \"predicted camera\" are seen through the annotated cameras; \"true "
    "keypoints\" says what these leave to gain.";

constexpr const char* kErrorNote =
    " ±: standard error of the mean over models, of which a class has few: differences "
    "between runs on the same models are known better (eval --compare).";

std::string Notes(const Evaluation& evaluation) {
  if (Classifies(evaluation)) return ClassifierNotes(evaluation);
  if (IsOfPhotographs(evaluation)) return kPhotographNotes;
  std::string notes;
  if (evaluation.shape_threshold > 0)
    notes = fmt::format(
        "Best single shape: voxels that at least {:.0f} % of the training models have, the share "
        "that scores best on the training models.",
        100 * evaluation.shape_threshold);
  if (evaluation.retrieval_models > 0)
    notes += fmt::format(
        " Nearest training picture: the shape and the colours of that of {} training models which "
        "has the picture most like the input.",
        evaluation.retrieval_models);
  if (evaluation.voxels != "ours")
    notes += fmt::format(" 3D IoU: of voxels by the rule of {}.", evaluation.voxels);
  if (HasAny(evaluation, &Score::carved_iou))
    notes +=
        " Carved IoU: mean over classes of the IoU with voxels by the paper's rule (binvox -cb -dc "
        "-aw).";
  if (HasAny(evaluation, &Score::color_l1))
    notes +=
        " Colour L1: mean difference of colour in views all around, over the pixels that the "
        "object or its prediction covers, of 1.";
  if (HasAny(evaluation, &Score::shared_color_l1))
    notes +=
        " Where both are: the same over the pixels that both cover; then apart for the sides of a "
        "prediction that its picture shows, and for the others.";
  if (HasAny(evaluation, &Score::texture_l1))
    notes +=
        " Texture L1 and texture + light L1: mean difference of colour over all pixels of the "
        "input's view, without light and with it, of 1.";
  if (HasAny(evaluation, &Score::light_angle))
    notes +=
        " Light: angle between its direction and the true one; light / constant: as a multiple of "
        "that of the mean light. Search: the light under which the prediction, or what it is given "
        "of the truth, is most like the input.";
  const auto has_error = [](const EvaluationRow& row) { return row.error.has_value(); };
  if (std::ranges::any_of(evaluation.rows, has_error)) notes += kErrorNote;
  if (evaluation.unusable_predictions > 0)
    notes += fmt::format(" {} predictions without extent or area score 0.",
                         evaluation.unusable_predictions);
  return notes.starts_with(' ') ? notes.substr(1) : notes;
}

Json ToJson(const Score& score) {
  if (score.accuracy) return {{"accuracy", *score.accuracy}};
  Json json = {{"iou", score.iou}, {"f_score", nullptr}};
  for (const ScoreMeasure& measure : kMeasures) {
    if (const auto number = measure.Of(score)) json[measure.key] = *number;
  }
  return json;
}

Json ToJson(const Evaluation& evaluation, const EvaluationRow& row) {
  Json classes = Json::array();
  for (const auto& score : row.classes) classes.push_back(ToJson(score));
  Json json = {{"method", row.method}, {"classes", std::move(classes)}, {"mean", ToJson(row.mean)}};
  if (row.error) json["error"] = ToJson(*row.error);
  if (const auto ratio = LightOfConstant(evaluation, row)) json["light_of_constant"] = *ratio;
  return json;
}

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

bool Classifies(const Evaluation& evaluation) { return HasAny(evaluation, &Score::accuracy); }

bool IsOfPhotographs(const Evaluation& evaluation) { return HasAny(evaluation, &Score::mask_loss); }

const char* ScoredThing(const Evaluation& evaluation) {
  return IsOfPhotographs(evaluation) ? "photograph" : "model";
}

const char* MainMeasure(const Evaluation& evaluation) {
  if (HasAny(evaluation, &Score::pck)) return "keypoints within 0.1";
  if (IsOfPhotographs(evaluation)) return "2D IoU";
  return Classifies(evaluation) ? "accuracy" : "3D IoU";
}

std::string FormatTable(const Evaluation& evaluation) {
  const auto cells = Cells(evaluation);
  const auto widths = Widths(cells);
  std::string out = Caption(evaluation) + "\n\n";
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::string line = Join(cells[i], widths, "  ");
    out += line + "\n";
    if (i == 0) out += std::string(line.size(), '-') + "\n";
  }
  return out + "\n" + Notes(evaluation) + "\n";
}

std::string FormatMarkdown(const Evaluation& evaluation) {
  auto cells = Cells(evaluation);
  for (auto& line : cells) {
    for (std::string& cell : line) cell = EscapeMarkdown(cell);
  }
  const auto widths = Widths(cells);
  std::string out = fmt::format("# Evaluation\n\n{}\n\n{}.\n\n",
                                EscapeMarkdown(evaluation.predictor), Caption(evaluation));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    out += "| " + Join(cells[i], widths, " | ") + " |\n";
    if (i > 0) continue;
    out += "|" + std::string(widths[0] + 2, '-');
    for (std::size_t k = 1; k < widths.size(); ++k)
      out += "|" + std::string(widths[k] + 1, '-') + ":";
    out += "|\n";
  }
  return out + "\n" + Notes(evaluation) + "\n";
}

nlohmann::ordered_json EvaluationJson(const Evaluation& evaluation) {
  Json json = {{"predictor", evaluation.predictor},
               {"dataset", evaluation.dataset_source},
               {"split", evaluation.split},
               {"views_per_model", evaluation.views_per_model},
               {"f_score_threshold", kFScoreThreshold},
               {"shape_threshold", evaluation.shape_threshold},
               {"retrieval_models", evaluation.retrieval_models},
               {"unusable_predictions", evaluation.unusable_predictions},
               {"classes", evaluation.classes},
               {"class_models", evaluation.class_models},
               {"rows", Json::array()},
               {"models", Json::array()}};
  if (evaluation.voxels != "ours") json["voxels"] = evaluation.voxels;
  for (const auto& row : evaluation.rows) json["rows"].push_back(ToJson(evaluation, row));
  for (const ModelScore& model : evaluation.models) {
    Json entry = ToJson(model.score);
    entry["class"] = model.class_name;
    entry["id"] = model.id;
    if (!model.shape.empty()) entry["shape"] = model.shape;
    json["models"].push_back(std::move(entry));
  }
  return json;
}

Status WriteEvaluation(const Path& run, const Evaluation& evaluation, const std::string& name) {
  const Path numbers = run / (name + ".json"), table = run / (name + ".md");
  for (const Path& file : {numbers, table}) RemoveTemporariesOf(file);
  TILEGRAD_TRY(WriteTextAtomic(numbers, JsonText(EvaluationJson(evaluation), 1) + "\n"));
  return WriteTextAtomic(table, FormatMarkdown(evaluation));
}

Result<std::optional<Evaluation>> ReadEvaluation(const Path& run, const std::string& name) {
  const Path file = run / (name + ".json");
  if (!PathExists(file)) return std::optional<Evaluation>();
  const std::string place = file.string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  TILEGRAD_ASSIGN(const ParsedJson json, ParseJson(text, place));
  Evaluation out;
  JsonFields fields(json, place);
  const int most = std::numeric_limits<int>::max();
  fields.Read("predictor", &out.predictor);
  fields.Read("split", &out.split);
  if (json.is_object() && json.contains("dataset")) fields.Read("dataset", &out.dataset_source);
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

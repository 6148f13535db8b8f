// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "base/escape_text.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/text.h"
#include "train/eval/evaluation.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

std::string Cell(const Score& score) {
  if (score.accuracy || score.mask_loss) return fmt::format("{:.1f}", 100 * score.main());
  return score.f_score ? fmt::format("{:.1f} / {:.1f}", 100 * score.iou, 100 * *score.f_score)
                       : fmt::format("{:.1f} / -", 100 * score.iou);
}

bool HasAny(const Evaluation& evaluation, std::optional<double> Score::*measure) {
  return std::any_of(evaluation.rows.begin(), evaluation.rows.end(),
                     [&](const EvaluationRow& row) { return (row.mean.*measure).has_value(); });
}

// Of the mean over classes, where a row has it.
struct Column {
  std::optional<double> Score::*measure;
  const char* heading;
  double factor;
  int digits;
};
constexpr Column kColumns[] = {{&Score::carved_iou, "carved IoU", 100, 1},
                               {&Score::color_l1, "colour L1", 1, 3},
                               {&Score::texture_l1, "texture L1", 1, 4},
                               {&Score::light_angle, "light, degrees", 1, 1},
                               {&Score::lit_l1, "texture + light L1", 1, 4},
                               {&Score::mask_loss, "2D IoU loss", 1, 3},
                               {&Score::pck, "PCK@0.1", 1, 3}};

// Heading, then a line a method: the cells of the table as text.
std::vector<std::vector<std::string>> Cells(const Evaluation& evaluation) {
  std::vector<std::vector<std::string>> cells = {{"method"}};
  for (const auto& name : evaluation.classes) cells[0].push_back(name);
  cells[0].push_back("mean");
  for (const Column& column : kColumns) {
    if (HasAny(evaluation, column.measure)) cells[0].emplace_back(column.heading);
  }
  for (const auto& row : evaluation.rows) {
    auto& line = cells.emplace_back(1, row.method);
    for (const auto& score : row.classes) line.push_back(Cell(score));
    line.push_back(Cell(row.mean));
    for (const Column& column : kColumns) {
      if (!HasAny(evaluation, column.measure)) continue;
      const std::optional<double>& value = row.mean.*column.measure;
      line.push_back(value ? fmt::format("{:.{}f}", column.factor * *value, column.digits) : "-");
    }
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
  for (std::size_t i = 1; i < line.size(); ++i) {
    out += fmt::format("{}{:>{}}", between, line[i], widths[i]);
  }
  return out;
}

std::string Caption(const Evaluation& evaluation) {
  int models = 0;
  for (const int n : evaluation.class_models) models += n;
  if (IsOfPhotographs(evaluation))
    return fmt::format("{} (%) on {} of the {} split", MainMeasure(evaluation),
                       Count(models, "photograph"), evaluation.split);
  const std::string measures =
      Classifies(evaluation)
          ? "Accuracy (%)"
          : fmt::format("3D IoU at 32^3 (%) / F-score at {} (%)", kFScoreThreshold);
  return fmt::format("{} on {} of the {} split, {} each", measures, Count(models, "model"),
                     evaluation.split, Count(evaluation.views_per_model, "view"));
}

std::string ClassifierNotes(const Evaluation& evaluation) {
  std::string notes = "Most frequent class: always that of most training pictures.";
  if (evaluation.retrieval_models > 0) {
    notes += fmt::format(
        " Nearest training picture: the class of that of {} training models which has the picture "
        "most like the input.",
        evaluation.retrieval_models);
  }
  return notes;
}

constexpr const char* kPhotographNotes =
    "Table 3: texture L1 is the mean difference of colour between prediction and object over all "
    "pixels of the crop, black beyond them; 2D IoU loss is 1 - IoU of their silhouettes; PCK@0.1 "
    "is "
    "the share of visible keypoints within a tenth of the box's longer side, a mean over "
    "keypoints. "
    "All but \"predicted camera\" are seen through the annotated cameras.";

std::string Notes(const Evaluation& evaluation) {
  if (Classifies(evaluation)) return ClassifierNotes(evaluation);
  if (IsOfPhotographs(evaluation)) return kPhotographNotes;
  std::string notes;
  if (evaluation.shape_threshold > 0) {
    notes = fmt::format(
        "Best single shape: voxels that at least {:.0f} % of the training models have, the share "
        "that scores best on the training models.",
        100 * evaluation.shape_threshold);
  }
  if (evaluation.retrieval_models > 0) {
    notes += fmt::format(
        " Nearest training picture: the shape and the colours of that of {} training models which "
        "has the picture most like the input.",
        evaluation.retrieval_models);
  }
  if (HasAny(evaluation, &Score::carved_iou)) {
    notes +=
        " Carved IoU: mean over classes of the IoU with voxels by the paper's rule (binvox -cb -dc "
        "-aw).";
  }
  if (HasAny(evaluation, &Score::color_l1)) {
    notes +=
        " Colour L1: mean difference of colour in views all around, over the pixels that the "
        "object "
        "or its prediction covers, of 1.";
  }
  if (HasAny(evaluation, &Score::texture_l1)) {
    notes +=
        " Texture L1 and texture + light L1: mean difference of colour over all pixels of the "
        "input's view, without light and with it, of 1. Light: angle between its direction and the "
        "true one.";
  }
  if (evaluation.unusable_predictions > 0) {
    notes += fmt::format(" {} predictions without extent or area score 0.",
                         evaluation.unusable_predictions);
  }
  return notes.starts_with(' ') ? notes.substr(1) : notes;
}

Json ToJson(const Score& score) {
  if (score.accuracy) return {{"accuracy", *score.accuracy}};
  Json json = {{"iou", score.iou}, {"f_score", nullptr}};
  if (score.f_score) json["f_score"] = *score.f_score;
  if (score.carved_iou) json["carved_iou"] = *score.carved_iou;
  if (score.color_l1) json["color_l1"] = *score.color_l1;
  if (score.texture_l1) json["texture_l1"] = *score.texture_l1;
  if (score.lit_l1) json["lit_l1"] = *score.lit_l1;
  if (score.light_angle) json["light_angle"] = *score.light_angle;
  if (score.mask_loss) json["mask_loss"] = *score.mask_loss;
  if (score.pck) json["pck"] = *score.pck;
  return json;
}

}  // namespace

bool Classifies(const Evaluation& evaluation) { return HasAny(evaluation, &Score::accuracy); }

bool IsOfPhotographs(const Evaluation& evaluation) { return HasAny(evaluation, &Score::mask_loss); }

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
  for (const auto& row : evaluation.rows) {
    Json classes = Json::array();
    for (const auto& score : row.classes) classes.push_back(ToJson(score));
    json["rows"].push_back(
        {{"method", row.method}, {"classes", std::move(classes)}, {"mean", ToJson(row.mean)}});
  }
  for (const ModelScore& model : evaluation.models) {
    Json entry = ToJson(model.score);
    entry["class"] = model.class_name;
    entry["id"] = model.id;
    json["models"].push_back(std::move(entry));
  }
  return json;
}

Status WriteEvaluation(const Path& run, const Evaluation& evaluation) {
  for (const char* name : {"eval.json", "eval.md"}) RemoveTemporariesOf(run / name);
  TILEGRAD_TRY(WriteTextAtomic(run / "eval.json", JsonText(EvaluationJson(evaluation), 1) + "\n"));
  return WriteTextAtomic(run / "eval.md", FormatMarkdown(evaluation));
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// The evaluation as a table: a row a class, the methods side by side for each measure.
#include <algorithm>
#include <cmath>
#include <span>

#include "base/error.h"
#include "base/text.h"
#include "train/report/html.h"
#include "train/report/sections.h"

namespace tilegrad::train {
namespace {

using Values = std::vector<std::optional<double>>;

// Percent with one digit: what is printed is what is compared.
std::optional<double> Shown(std::optional<double> share) {
  return share ? std::optional(std::round(1000 * *share) / 10) : std::nullopt;
}

// One cell a method; every value that equals the best is marked.
std::string CellsHtml(const Values& values) {
  std::optional<double> best;
  for (const auto& value : values) best = std::max(best, Shown(value));
  std::string out;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const char* group = i == 0 ? " first" : "";
    const auto shown = Shown(values[i]);
    if (!shown)
      out += fmt::format("<td class=\"number{}\">–</td>", group);
    else if (shown == best)
      out += fmt::format("<td class=\"number best{}\"><strong>{:.1f}</strong></td>", group, *shown);
    else
      out += fmt::format("<td class=\"number{}\">{:.1f}</td>", group, *shown);
  }
  return out;
}

// Whether there is an F-score beside the main measure.
bool HasFScores(const Evaluation& evaluation) {
  return !Classifies(evaluation) && !IsOfPhotographs(evaluation);
}

// `pick` gives the score of a method's row.
template <class Pick>
std::string LineHtml(const Evaluation& evaluation, const std::string& heading, Pick pick) {
  Values main, f_score;
  for (const auto& row : evaluation.rows) {
    main.emplace_back(pick(row).main());
    f_score.push_back(pick(row).f_score);
  }
  return fmt::format("<tr><th scope=\"row\">{}</th>{}{}</tr>\n", heading, CellsHtml(main),
                     HasFScores(evaluation) ? CellsHtml(f_score) : "");
}

std::string FScoreHead(const Evaluation& evaluation) {
  return fmt::format("<th colspan=\"{}\" scope=\"colgroup\" class=\"first\">F-score at {}, %</th>",
                     evaluation.rows.size(), kFScoreThreshold);
}

std::string HeadHtml(const Evaluation& evaluation) {
  std::string methods;
  const bool f_scores = HasFScores(evaluation);
  for (int group = 0; group < (f_scores ? 2 : 1); ++group) {
    for (std::size_t i = 0; i < evaluation.rows.size(); ++i) {
      methods += fmt::format("<th scope=\"col\" class=\"number{}\">{}</th>", i == 0 ? " first" : "",
                             EscapeHtml(evaluation.rows[i].method));
    }
  }
  return fmt::format(
      "<thead><tr><th rowspan=\"2\" scope=\"col\">class (models)</th>"
      "<th colspan=\"{0}\" scope=\"colgroup\" class=\"first\">{1}, %</th>{2}</tr>\n"
      "<tr>{3}</tr></thead>\n",
      evaluation.rows.size(), f_scores ? "3D IoU at 32³" : MainMeasure(evaluation),
      f_scores ? FScoreHead(evaluation) : "", methods);
}

std::string NotesHtml(const ReportFacts& facts) {
  const Evaluation& evaluation = *facts.evaluation;
  std::string out = fmt::format(
      "{} split, {} of each model; the mean is over classes; the best of each measure is bold.",
      EscapeHtml(evaluation.split), Count(evaluation.views_per_model, "view"));
  out[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(out[0])));
  if (evaluation.shape_threshold > 0) {
    out += fmt::format(
        " The best single shape holds the voxels that at least {:.0f} % of the training models "
        "have, the share that scores best on the training models.",
        100 * evaluation.shape_threshold);
  }
  if (evaluation.unusable_predictions > 0) {
    out += fmt::format(" {} predictions without extent or area score 0.",
                       evaluation.unusable_predictions);
  }
  if (evaluation.predictor != facts.predictor) {
    out += fmt::format(" The scores are of: {}; the pictures and meshes of this page are of: {}.",
                       EscapeHtml(evaluation.predictor), EscapeHtml(facts.predictor));
  }
  return out;
}

// A table of errors beside the scores: `columns`, a line a method, what they are.
std::string SideTable(const char* label, std::span<const char* const> columns,
                      const std::string& lines, const char* note) {
  std::string head = "<th scope=\"col\">method</th>";
  for (const char* column : columns)
    head += fmt::format("<th scope=\"col\" class=\"number\">{}</th>", column);
  return fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"{}\">"
      "<table class=\"scores\">\n<thead><tr>{}</tr></thead>\n"
      "<tbody>\n{}</tbody></table></div>\n<p class=\"note\">{}</p>\n",
      label, head, lines, note);
}

struct SideCell {
  std::optional<double> value;
  int digits;
};

std::string SideLine(const std::string& method, std::initializer_list<SideCell> cells) {
  std::string out = fmt::format("<tr><th scope=\"row\">{}</th>", EscapeHtml(method));
  for (const auto& [value, digits] : cells) {
    out += fmt::format("<td class=\"number\">{}</td>",
                       value ? fmt::format("{:.{}f}", *value, digits) : "–");
  }
  return out + "</tr>\n";
}

// Table 3 of the paper.
std::string PhotographsHtml(const Evaluation& evaluation) {
  std::string lines;
  for (const auto& row : evaluation.rows) {
    lines += SideLine(row.method,
                      {{row.mean.texture_l1, 4}, {row.mean.mask_loss, 3}, {row.mean.pck, 3}});
  }
  static constexpr const char* kColumns[] = {"texture L1", "2D IoU loss", "PCK@0.1"};
  return SideTable("Photographs", kColumns, lines,
                   "Lower is better for the first two, higher for PCK: the share of keypoints "
                   "within a tenth of the box's longer side.");
}

// Texture and light, of tasks that predict them.
std::string LightHtml(const Evaluation& evaluation) {
  std::string lines;
  for (const EvaluationRow& row : evaluation.rows) {
    if (!row.mean.texture_l1) continue;
    lines += SideLine(row.method,
                      {{row.mean.texture_l1, 4}, {row.mean.light_angle, 1}, {row.mean.lit_l1, 4}});
  }
  if (lines.empty()) return "";
  static constexpr const char* kColumns[] = {"texture L1", "light, °", "texture + light L1"};
  return SideTable("Texture and light", kColumns, lines,
                   "L1: mean colour difference over all pixels of the input view, on a scale of 0 "
                   "to 1. Light: angle between the predicted and the true direction. Lower is "
                   "better.");
}

}  // namespace

std::string ScoresHtml(const ReportFacts& facts) {
  if (facts.showcase.generated) {
    return fmt::format(
        "<p>To compare them with true objects as a set: <code>tilegrad {} --run {}</code>.</p>",
        facts.run.config.task->ScoreCommand(), EscapeHtml(facts.run.folder.string()));
  }
  if (!facts.evaluation) {
    return fmt::format(
        "<p>It has not been evaluated yet: run <code>tilegrad eval --run {}</code>, then make this "
        "report again.</p>",
        EscapeHtml(facts.run.folder.string()));
  }
  const Evaluation& evaluation = *facts.evaluation;
  std::string lines;
  for (std::size_t c = 0; c < evaluation.classes.size(); ++c) {
    const std::string heading =
        fmt::format("{} <span class=\"count\">({})</span>", EscapeHtml(evaluation.classes[c]),
                    evaluation.class_models[c]);
    lines += LineHtml(evaluation, heading, [c](const auto& row) { return row.classes[c]; });
  }
  const std::string mean = LineHtml(evaluation, "mean", [](const auto& row) { return row.mean; });
  return fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Scores\"><table "
      "class=\"scores\">\n{}<tbody>\n{}</tbody>\n<tfoot>\n{}</tfoot>\n</table></div>\n"
      "<p class=\"note\">{}</p>{}",
      HeadHtml(evaluation), lines, mean, NotesHtml(facts),
      IsOfPhotographs(evaluation) ? PhotographsHtml(evaluation) : LightHtml(evaluation));
}

}  // namespace tilegrad::train

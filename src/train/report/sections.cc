// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <span>

#include "base/error.h"
#include "base/text.h"
#include "train/report/html.h"
#include "train/report/report.h"

namespace tilegrad::train {
namespace {

std::string Comparison(const Evaluation& evaluation) {
  std::string out;
  for (std::size_t i = 0; i + 1 < evaluation.rows.size(); ++i) {
    const EvaluationRow& row = evaluation.rows[i];
    out += fmt::format("; {}: {:.1f} %", EscapeHtml(row.method), 100 * row.mean.main());
  }
  return out + ".";
}

// Whether the methods differ in light only, so that images compare them.
bool IsOfLight(const Evaluation& evaluation) {
  return evaluation.rows.back().mean.lit_l1.has_value();
}

std::string ComparisonOfLight(const Evaluation& evaluation) {
  const Score& own = evaluation.rows.back().mean;
  std::string out = fmt::format(
      ". Under the predicted light, the mean colour error of its renders is <b>{:.4f}</b> of 1",
      *own.lit_l1);
  for (std::size_t i = 0; i + 1 < evaluation.rows.size(); ++i) {
    const EvaluationRow& row = evaluation.rows[i];
    if (!row.mean.lit_l1) continue;
    out += fmt::format("; {}: {:.4f}", EscapeHtml(row.method), *row.mean.lit_l1);
  }
  if (own.light_angle)
    out += fmt::format("; the predicted lights are off by {:.1f} degrees", *own.light_angle);
  return out + ".";
}

std::string EvaluationSentence(const ReportFacts& facts) {
  if (facts.showcase.generated) return "";
  if (!facts.evaluation) return "It has not been evaluated yet.";
  const Evaluation& evaluation = *facts.evaluation;
  std::int64_t models = 0;
  for (const int n : evaluation.class_models) models += n;
  return fmt::format(
      "Mean {} on {} {} of the {} split: <b>{:.1f} %</b>{}", MainMeasure(evaluation),
      WithCommas(models), Plural(ScoredThing(evaluation), models == 1),
      EscapeHtml(evaluation.split), 100 * evaluation.rows.back().mean.main(),
      IsOfLight(evaluation) ? ComparisonOfLight(evaluation) : Comparison(evaluation));
}

std::string HeldOutSentence(const ReportFacts& facts) {
  if (facts.showcase.generated) return "";
  if (facts.listed) return "None of these was seen in training. ";
  return "The run has no list of what it was trained on: these may be among it. ";
}

Result<std::string> FigureHtml(const ShownPicture& picture) {
  TILEGRAD_ASSIGN(const std::string address, PngAddress(picture.image));
  return fmt::format(
      "<figure><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"><figcaption>{}</figcaption>"
      "</figure>\n",
      address, 2 * picture.image.width, 2 * picture.image.height, EscapeHtml(picture.alt),
      EscapeHtml(picture.caption));
}

// The mean over a model's views, or nothing.
std::string ModelScoreHtml(const ReportFacts& facts, const Example& example) {
  if (!facts.evaluation) return "";
  for (const ModelScore& entry : facts.evaluation->models) {
    if (entry.class_name != example.class_name || entry.id != example.id) continue;
    std::string text = fmt::format("<span>{} {:.1f} %</span>", MainMeasure(*facts.evaluation),
                                   100 * entry.score.main());
    if (entry.score.f_score)
      text += fmt::format(" <span>F-score {:.1f} %</span>", 100 * *entry.score.f_score);
    return "<p class=\"score\">" + text + "</p>";
  }
  return "";
}

Result<std::string> RowHtml(const ReportFacts& facts, std::size_t index) {
  const Example& example = facts.showcase.examples[index];
  std::string pictures;
  for (const ShownPicture& picture : example.pictures) {
    TILEGRAD_ASSIGN(const std::string figure, FigureHtml(picture));
    pictures += figure;
  }
  return fmt::format(
      "<article class=\"model\" data-model=\"{}\">\n<div class=\"about\"><h3>{}</h3>"
      "<p class=\"class\">{}</p>{}</div>\n<div class=\"views\">\n{}</div>\n</article>\n",
      index, EscapeHtml(example.name), EscapeHtml(example.class_name),
      ModelScoreHtml(facts, example), pictures);
}

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

// Whether there is an F-score besides the main measure.
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
    for (std::size_t i = 0; i < evaluation.rows.size(); ++i)
      methods += fmt::format("<th scope=\"col\" class=\"number{}\">{}</th>", i == 0 ? " first" : "",
                             EscapeHtml(evaluation.rows[i].method));
  }
  return fmt::format(
      "<thead><tr><th rowspan=\"2\" scope=\"col\">class ({4}s)</th>"
      "<th colspan=\"{0}\" scope=\"colgroup\" class=\"first\">{1}, %</th>{2}</tr>\n"
      "<tr>{3}</tr></thead>\n",
      evaluation.rows.size(), f_scores ? "3D IoU at 32³" : MainMeasure(evaluation),
      f_scores ? FScoreHead(evaluation) : "", methods, ScoredThing(evaluation));
}

std::string NotesHtml(const ReportFacts& facts) {
  const Evaluation& evaluation = *facts.evaluation;
  std::string out = fmt::format(
      "{} split, {} of each {}; the mean is over classes; the best of each measure is bold.",
      EscapeHtml(evaluation.split), Count(evaluation.views_per_model, "view"),
      ScoredThing(evaluation));
  out[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(out[0])));
  if (evaluation.shape_threshold > 0)
    out += fmt::format(
        " The best single shape holds the voxels that at least {:.0f} % of the training models "
        "have, the share that scores best on the training models.",
        100 * evaluation.shape_threshold);
  if (evaluation.unusable_predictions > 0)
    out += fmt::format(" {} predictions without extent or area score 0.",
                       evaluation.unusable_predictions);
  const std::string& source = evaluation.dataset_source;
  if (!source.empty() && source != facts.run.header.dataset_source)
    out += fmt::format(" The scored models are of another source than those trained on: {}.",
                       EscapeHtml(source));
  if (evaluation.predictor != facts.predictor)
    out += fmt::format(" The scores are of: {}; the pictures and meshes of this page are of: {}.",
                       EscapeHtml(evaluation.predictor), EscapeHtml(facts.predictor));
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
  for (const auto& [value, digits] : cells)
    out += fmt::format("<td class=\"number\">{}</td>",
                       value ? fmt::format("{:.{}f}", *value, digits) : "–");
  return out + "</tr>\n";
}

// Table 3 of the paper.
std::string PhotographsHtml(const Evaluation& evaluation) {
  std::string lines;
  for (const auto& row : evaluation.rows)
    lines += SideLine(row.method,
                      {{row.mean.texture_l1, 4}, {row.mean.mask_loss, 3}, {row.mean.pck, 3}});
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
                   "better. Search: the light under which the prediction, or what it is given of "
                   "the truth, is most like the input.");
}

}  // namespace

std::string SummaryHtml(const ReportFacts& facts) {
  const RunFacts& run = facts.run;
  const std::int64_t step = facts.step, steps = run.config.schedule.steps;
  const std::string progress = step >= steps
                                   ? WithCommas(step)
                                   : fmt::format("{} of {}", WithCommas(step), WithCommas(steps));
  return fmt::format("A network of {} parameters was trained for {} {} {}. {} {}",
                     WithCommas(run.header.parameters), progress,
                     Plural("step", std::max(step, steps) == 1), EscapeHtml(facts.showcase.purpose),
                     EscapeHtml(facts.showcase.data), EvaluationSentence(facts));
}

std::string ComparisonHtml(const ReportFacts& facts) {
  if (!facts.evaluation) return "";
  const auto& rows = facts.evaluation->rows;
  const bool light = IsOfLight(*facts.evaluation);
  double most = 1e-9;  // the longest bar's, of errors
  for (const auto& row : rows) most = std::max(most, row.mean.lit_l1.value_or(0));
  const std::string measure = light ? "error of texture + light" : MainMeasure(*facts.evaluation);
  std::string out =
      fmt::format("<dl class=\"bars\" aria-label=\"Mean {} of each method\">\n", measure);
  for (const auto& row : rows) {
    if (light && !row.mean.lit_l1) continue;
    const double share = light ? *row.mean.lit_l1 / most : std::clamp(row.mean.main(), 0.0, 1.0);
    const std::string value = light ? fmt::format("{:.4f}", *row.mean.lit_l1)
                                    : fmt::format("{:.1f} %", 100 * row.mean.main());
    out += fmt::format(
        "<div{}><dt>{}</dt><dd><span class=\"bar\" style=\"width:{:.1f}%\"></span>"
        "<span class=\"value\">{}</span></dd></div>\n",
        &row == &rows.back() ? " class=\"own\"" : "", EscapeHtml(row.method), 80 * share, value);
  }
  const bool voxels = !Classifies(*facts.evaluation) && !IsOfPhotographs(*facts.evaluation);
  const char* note =
      light    ? ", mean colour difference in the input view, on a scale of 0 to 1; lower is better"
      : voxels ? ", 32³ voxels"
               : "";
  return out + fmt::format("</dl>\n<p class=\"note\">Mean {} over classes, held-out {}s{}.</p>",
                           measure, facts.showcase.thing, note);
}

Result<std::string> ModelsHtml(const ReportFacts& facts) {
  if (facts.showcase.examples.empty())
    return fmt::format("<p>The dataset has no test {}s to show.</p>", facts.showcase.thing);
  std::string out =
      "<p class=\"note\">" + HeldOutSentence(facts) + EscapeHtml(facts.showcase.note) + "</p>\n";
  for (std::size_t i = 0; i < facts.showcase.examples.size(); ++i) {
    TILEGRAD_ASSIGN(const std::string row, RowHtml(facts, i));
    out += row;
  }
  return out;
}

std::string CommandsHtml(const ReportFacts& facts) {
  const std::string run = ShellWord(facts.run.folder.string()), data = ShellWord(facts.data);
  const std::string config = ShellWord((facts.run.folder / "config.toml").string());
  return EscapeHtml(
      fmt::format("tilegrad train --config {} --data {} --out runs/again\n"
                  "tilegrad {} --run runs/again\n"
                  "tilegrad report --run runs/again\n"
                  "\n"
                  "tilegrad report --run {} --data {}   # this page",
                  config, data, facts.run.config.task->ScoreCommand(), run, data));
}

std::string MachineHtml(const ReportFacts& facts) {
  std::string out;
  const auto add = [&](const std::string& name, const std::string& value) {
    out += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", EscapeHtml(name),
                       EscapeHtml(value));
  };
  add("predictor", facts.predictor);
  add("dataset", facts.data + " (" + facts.run.header.dataset_source + ")");
  for (const auto& [name, value] : facts.run.header.machine) add(name, value);
  return out;
}

std::string CreditsHtml(const ReportFacts& facts) {
  std::string out = "<ul>\n";
  for (const auto& credit : facts.showcase.credits) out += "<li>" + EscapeHtml(credit) + "</li>\n";
  for (const Example& shown : facts.showcase.examples) {
    if (facts.showcase.generated) break;
    out += fmt::format("<li><b>{}</b>, by {}, licence: {}</li>\n", EscapeHtml(shown.name),
                       shown.creator.empty() ? "an unnamed creator" : EscapeHtml(shown.creator),
                       shown.license.empty() ? "not stated" : EscapeHtml(shown.license));
  }
  return out + "</ul>";
}

std::string ScoresHtml(const ReportFacts& facts) {
  if (facts.showcase.generated)
    return fmt::format(
        "<p>To compare them with true objects as a set: <code>tilegrad {} --run {}</code>.</p>",
        facts.run.config.task->ScoreCommand(), EscapeHtml(ShellWord(facts.run.folder.string())));
  if (!facts.evaluation)
    return fmt::format(
        "<p>It has not been evaluated yet: run <code>tilegrad eval --run {}</code>, then make this "
        "report again.</p>",
        EscapeHtml(ShellWord(facts.run.folder.string())));
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

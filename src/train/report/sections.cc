// SPDX-License-Identifier: Apache-2.0
#include "train/report/sections.h"

#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "train/report/html.h"

namespace tilegrad::train {
namespace {

std::string Comparison(const Evaluation& evaluation) {
  const auto& rows = evaluation.rows;
  const double own = rows.back().mean.main();
  const auto beaten = static_cast<std::size_t>(std::count_if(
      rows.begin(), rows.end() - 1, [&](const auto& row) { return row.mean.main() < own; }));
  std::string baselines;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    baselines += fmt::format("{}the {} has {:.1f} %", i > 0 ? ", " : "", EscapeHtml(rows[i].method),
                             100 * rows[i].mean.main());
  }
  if (baselines.empty()) return ".";
  const char* verdict = beaten + 1 == rows.size() ? "above every baseline"
                        : beaten > 0              ? "above one baseline but not all"
                                                  : "not above the baselines";
  return fmt::format(", {}: {}.", verdict, baselines);
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
      "On {} {} of the {} split it reaches a mean {} of <b>{:.1f} %</b>{}", WithCommas(models),
      Plural("model", models == 1), EscapeHtml(evaluation.split), MainMeasure(evaluation),
      100 * evaluation.rows.back().mean.main(),
      IsOfLight(evaluation) ? ComparisonOfLight(evaluation) : Comparison(evaluation));
}

// A word as a shell reads it back.
std::string Quoted(const std::string& word) {
  constexpr std::string_view kSafe =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./=:,+@%";
  if (!word.empty() && word.find_first_not_of(kSafe) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
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
  return out + fmt::format("</dl>\n<p class=\"note\">Mean {} over classes, held-out models{}.</p>",
                           measure, note);
}

Result<std::string> ModelsHtml(const ReportFacts& facts) {
  if (facts.showcase.examples.empty())
    return std::string("<p>The dataset has no test models to show.</p>");
  std::string out = "<p class=\"note\">" + EscapeHtml(facts.showcase.note) + "</p>\n";
  for (std::size_t i = 0; i < facts.showcase.examples.size(); ++i) {
    TILEGRAD_ASSIGN(const std::string row, RowHtml(facts, i));
    out += row;
  }
  return out;
}

std::string CommandsHtml(const ReportFacts& facts) {
  const std::string run = Quoted(facts.run.folder.string()), data = Quoted(facts.data);
  const std::string config = Quoted((facts.run.folder / "config.toml").string());
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

}  // namespace tilegrad::train

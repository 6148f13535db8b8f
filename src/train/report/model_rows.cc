// SPDX-License-Identifier: Apache-2.0
// Pictures of the shown models.
#include "base/error.h"
#include "train/report/html.h"
#include "train/report/sections.h"

namespace tilegrad::train {
namespace {

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

}  // namespace tilegrad::train

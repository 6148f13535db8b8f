// SPDX-License-Identifier: Apache-2.0
// Pictures of the shown models, in pairs of truth and prediction.
#include <cmath>

#include "base/error.h"
#include "train/report/html.h"
#include "train/report/sections.h"

namespace tilegrad::train {
namespace {

struct Figure {
  const ImageU8& image;
  std::string caption, alt;
};

Result<std::string> FigureHtml(const Figure& figure) {
  TILEGRAD_ASSIGN(const std::string address, PngAddress(figure.image));
  return fmt::format(
      "<figure><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"><figcaption>{}</figcaption>"
      "</figure>\n",
      address, 2 * figure.image.width, 2 * figure.image.height, EscapeHtml(figure.alt),
      EscapeHtml(figure.caption));
}

// The mean over a model's views, or nothing.
std::string ModelScoreHtml(const ReportFacts& facts, int model) {
  if (!facts.evaluation) return "";
  for (const ModelScore& entry : facts.evaluation->models) {
    if (entry.model != model) continue;
    std::string text = fmt::format("<span>3D IoU {:.1f} %</span>", 100 * entry.score.iou);
    if (entry.score.f_score)
      text += fmt::format(" <span>F-score {:.1f} %</span>", 100 * *entry.score.f_score);
    return "<p class=\"score\">" + text + "</p>";
  }
  return "";
}

// How far the camera of each shown view has gone around from the first, in whole degrees.
std::vector<int> Turns(const DatasetInfo& info) {
  std::vector<int> turns;
  const std::vector<int> views = ShownViews(info);
  for (const int view : views) {
    const int steps = (view - views[0] + info.views) % info.views;
    turns.push_back(static_cast<int>(std::lround(std::abs(info.camera.azimuth_step) * steps)) %
                    360);
  }
  return turns;
}

Result<std::string> PicturesHtml(const ShownModel& shown, const std::string& name,
                                 const std::vector<int>& turns) {
  std::string out;
  for (std::size_t v = 0; v < turns.size(); ++v) {
    const std::string truth = v == 0 ? "input" : fmt::format("truth, +{}°", turns[v]);
    const std::string view = v == 0 ? "" : fmt::format(", camera turned by {}°", turns[v]);
    TILEGRAD_ASSIGN(
        const std::string left,
        FigureHtml({shown.truth_views[v], truth,
                    name + (v == 0 ? ": the image that the network sees" : ": truth") + view}));
    TILEGRAD_ASSIGN(const std::string right, FigureHtml({shown.predicted_views[v], "predicted",
                                                         name + ": predicted" + view}));
    out += left + right;
  }
  return out;
}

Result<std::string> RowHtml(const ReportFacts& facts, std::size_t index) {
  const ShownModel& shown = facts.models[index];
  const DatasetInfo& info = facts.dataset->info();
  const ModelInfo& model = facts.dataset->models()[static_cast<std::size_t>(shown.model)];
  const std::string name = model.name.empty() ? model.id : model.name;
  TILEGRAD_ASSIGN(const std::string pictures, PicturesHtml(shown, name, Turns(info)));
  return fmt::format(
      "<article class=\"model\" data-model=\"{}\">\n<div class=\"about\"><h3>{}</h3>"
      "<p class=\"class\">{}</p>{}</div>\n<div class=\"views\">\n{}</div>\n</article>\n",
      index, EscapeHtml(name),
      EscapeHtml(info.classes[static_cast<std::size_t>(model.class_index)]),
      ModelScoreHtml(facts, shown.model), pictures);
}

}  // namespace

Result<std::string> ModelsHtml(const ReportFacts& facts) {
  if (facts.models.empty()) return std::string("<p>The dataset has no test models to show.</p>");
  std::string out;
  for (std::size_t i = 0; i < facts.models.size(); ++i) {
    TILEGRAD_ASSIGN(const std::string row, RowHtml(facts, i));
    out += row;
  }
  return out;
}

}  // namespace tilegrad::train

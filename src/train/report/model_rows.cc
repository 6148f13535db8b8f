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

Result<std::string> PicturesHtml(const ShownModel& shown, const std::string& name, double step) {
  std::string out;
  for (std::size_t v = 0; v < shown.truth_views.size(); ++v) {
    const std::string turned = fmt::format("+{:.0f}°", std::abs(step) * static_cast<double>(v));
    const std::string view = v == 0 ? "the input's view" : "view turned by " + turned;
    TILEGRAD_ASSIGN(const std::string truth,
                    FigureHtml({shown.truth_views[v], v == 0 ? "input" : "truth, " + turned,
                                v == 0 ? name + ": the image that the network sees"
                                       : name + ": truth, " + view}));
    TILEGRAD_ASSIGN(const std::string predicted, FigureHtml({shown.predicted_views[v], "predicted",
                                                             name + ": predicted, " + view}));
    out += truth + predicted;
  }
  return out;
}

Result<std::string> RowHtml(const ReportFacts& facts, std::size_t index) {
  const ShownModel& shown = facts.models[index];
  const DatasetInfo& info = facts.dataset->info();
  const ModelInfo& model = facts.dataset->models()[static_cast<std::size_t>(shown.model)];
  const std::string name = model.name.empty() ? model.id : model.name;
  const double turn = info.camera.azimuth_step * (info.views / kShownViews);
  TILEGRAD_ASSIGN(const std::string pictures, PicturesHtml(shown, name, turn));
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

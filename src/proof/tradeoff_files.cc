// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "base/escape_text.h"
#include "proof/tradeoff_study.h"
#include "train/report/log_plot.h"

namespace tilegrad::cli {
namespace {

double Cost(const TradeoffRow& row) { return row.forward_ms + row.backward_ms; }

std::string Setting(const TradeoffRow& row) {
  return row.rule == AlphaRule::kPaper ? "the paper's rule"
                                       : fmt::format("{:g}", row.max_alpha_error);
}

std::string Heading(const StudyResult& r) {
  return fmt::format("{}, {} faces, {} x {} pixels, delta = {:.3g}", EscapeMarkdown(r.scene),
                     r.tradeoff.faces, r.size, r.size, r.delta);
}

std::string Table(const StudyResult& r) {
  std::string out = fmt::format(
      "### {}\n\nTruth: float64 over all faces on {} of {} rows; it would take {:.0f} ms forward "
      "and {:.0f} ms backward.\n\n"
      "| max_alpha_error | forward ms | backward ms | reported bound | largest error | mean error "
      "| "
      "gradient angle, degrees | gradient error |\n|--:|--:|--:|--:|--:|--:|--:|--:|\n",
      Heading(r), r.tradeoff.truth_rows, r.tradeoff.image_rows, r.tradeoff.truth_forward_ms,
      r.tradeoff.truth_backward_ms);
  for (const TradeoffRow& row : r.tradeoff.rows) {
    out += fmt::format("| {} | {:.3f} | {:.3f} | {:.1e} | {:.1e} | {:.1e} | {:.2g} | {:.1e} |\n",
                       Setting(row), row.forward_ms, row.backward_ms, row.reported, row.largest,
                       row.mean, row.gradient_angle, row.gradient_error);
  }
  return out + "\n";
}

// An error of nothing has no logarithm: half a unit in the last place of 1 stands for it.
double Shown(double error) { return std::max(error, 0x1p-25); }

}  // namespace

std::string StudyMarkdown(const std::vector<StudyResult>& results,
                          const std::vector<StudyTraining>& training) {
  std::string out;
  for (const StudyResult& r : results) out += Table(r);
  if (training.empty()) return out;
  out +=
      "### Training\n\n| max_alpha_error | steps | training s | mean 3D IoU | F-score |\n"
      "|--:|--:|--:|--:|--:|\n";
  for (const StudyTraining& t : training) {
    out += fmt::format("| {:g} | {} | {:.0f} | {:.1f} % | {:.1f} % |\n", t.max_alpha_error, t.steps,
                       t.seconds, 100 * t.iou, 100 * t.f_score);
  }
  return out + "\n";
}

std::string StudyCsv(const std::vector<StudyResult>& results) {
  std::string out =
      "scene,faces,size,delta,max_alpha_error,forward_ms,backward_ms,reported_bound,largest_error,"
      "mean_error,gradient_angle_degrees,gradient_error,truth_forward_ms,truth_backward_ms\n";
  for (const StudyResult& r : results) {
    for (const TradeoffRow& row : r.tradeoff.rows) {
      out += fmt::format(
          "{},{},{},{:.6g},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n",
          EscapeCsv(r.scene), r.tradeoff.faces, r.size, r.delta, Setting(row), row.forward_ms,
          row.backward_ms, row.reported, row.largest, row.mean, row.gradient_angle,
          row.gradient_error, r.tradeoff.truth_forward_ms, r.tradeoff.truth_backward_ms);
    }
  }
  return out;
}

std::string TrainingCsv(const std::vector<StudyTraining>& training) {
  std::string out = "max_alpha_error,steps,training_seconds,mean_iou,f_score\n";
  for (const StudyTraining& t : training) {
    out += fmt::format("{:g},{},{:.6g},{:.6g},{:.6g}\n", t.max_alpha_error, t.steps, t.seconds,
                       t.iou, t.f_score);
  }
  return out;
}

std::string StudyPicture(const std::vector<StudyResult>& results) {
  train::LogPlot plot{"CPU time, forward and backward, ms", "largest error of alpha", {}};
  for (const StudyResult& r : results) {
    train::LogSeries series{{fmt::format("{}, {} faces", EscapeControls(r.scene), r.tradeoff.faces),
                             fmt::format("{} pixels, delta = {:.3g}", r.size, r.delta)},
                            {}};
    for (const TradeoffRow& row : r.tradeoff.rows) {
      if (row.rule == AlphaRule::kPaper) continue;  // no curve goes through it
      series.points.push_back({std::max(Cost(row), 1e-3), Shown(row.largest),
                               fmt::format("max_alpha_error = {:g}", row.max_alpha_error)});
    }
    plot.series.push_back(std::move(series));
  }
  return train::LogPlotSvg(plot);
}

}  // namespace tilegrad::cli

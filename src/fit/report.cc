// SPDX-License-Identifier: Apache-2.0
// The page about a fit: one file that needs nothing else.
#include <algorithm>

#include "base/error.h"
#include "base/log_plot.h"
#include "fit/run.h"
#include "train/report/html.h"
#include "train/run/log.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kShownViews = 6;

constexpr const char* kPageHead =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
    "<title>tilegrad fit</title>\n<style>body{font:16px/1.5 sans-serif;max-width:60rem;margin:2rem "
    "auto;padding:0 1rem;color:#222;background:#fff}table{border-collapse:collapse}td,th{padding:"
    ".2rem .8rem .2rem 0;text-align:left}figure{display:inline-block;margin:0 1rem 1rem 0}img{max-"
    "width:100%;border:1px solid #ddd}svg{max-width:100%}pre{background:#f4f4f4;padding:1rem;"
    "overflow:auto}</style></head><body>\n<h1>tilegrad fit</h1>\n";

std::string Row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", EscapeHtml(name), EscapeHtml(value));
}

std::string Summary(const FitJob& job, const FitOutcome& o) {
  std::string out = "<table>\n";
  out += Row("images", fmt::format("{} fitted, {} held out, {} x {} pixels",
                                   job.input.training.size(), job.input.held_out.size(),
                                   job.input.images.width, job.input.images.height));
  out += Row("steps", fmt::format("{} in {:.1f} s", o.last_step, o.seconds));
  const auto scores = [&](const char* name, std::span<const ViewScore> views) {
    if (views.empty()) return;
    out += Row(name, fmt::format("PSNR {:.2f} dB, silhouette IoU {:.1f} %", MeanPsnr(views),
                                 100 * MeanIou(views)));
  };
  scores("fitted views", o.training), scores("held-out views", o.held_out);
  if (o.voxel_iou)
    out += Row("3D IoU at 32 voxels a side", fmt::format("{:.1f} %", 100 * *o.voxel_iou));
  if (o.camera_error_before && o.camera_error_after) {
    out += Row("cameras turned by", fmt::format("{:.2f} degrees at the start, {:.2f} at the end",
                                                *o.camera_error_before, *o.camera_error_after));
  }
  return out + "</table>\n";
}

std::string Doctor(const FitOutcome& o) {
  std::string out = "<h2>Gradients at the start</h2>\n<table>\n";
  for (const Finding& f : o.findings) out += Row(NameOf(f.parameter), f.sentence);
  return out + "</table>\n";
}

Result<std::string> Figure(const ImageU8& image, const std::string& caption) {
  TILEGRAD_ASSIGN(const std::string address, PngAddress(image));
  return fmt::format("<figure><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>\n",
                     EscapeHtml(caption), address);
}

Result<std::string> Views(const FitJob& job, const FitOutcome& o) {
  const bool held = !o.held_out.empty();
  std::span<const ViewScore> scores = held ? o.held_out : o.training;
  const std::size_t shown = std::min(kShownViews, scores.size());
  const std::string some =
      shown < scores.size() ? fmt::format(" (the first {} of {})", shown, scores.size()) : "";
  std::string out =
      fmt::format("<h2>{} views{}: image | fit</h2>\n", held ? "Held-out" : "Fitted", some);
  for (const ViewScore& s : scores.first(shown)) {
    const std::string& name = job.input.names[static_cast<std::size_t>(s.view)];
    TILEGRAD_ASSIGN(const std::string truth, Figure(s.truth, name));
    TILEGRAD_ASSIGN(const std::string rendered,
                    Figure(s.rendered, fmt::format("{:.2f} dB", s.psnr)));
    out += "<div>" + truth + rendered + "</div>\n";
  }
  return out;
}

// What is 0 has no place on a logarithmic axis.
Result<std::string> Curves(const FitJob& job) {
  TILEGRAD_ASSIGN(const std::vector<LogEntry> log, ReadLog(job.out));
  LogPlot plot{"step", "loss", {}};
  for (const char* name : {"loss", "color", "silhouette"}) {
    LogSeries series{{name}, {}};
    for (const LogEntry& entry : log) {
      for (const auto& [key, value] : entry.values) {
        if (key != name || !(value > 0)) continue;
        series.points.push_back({static_cast<double>(entry.step), value,
                                 fmt::format("step {}: {:.5f}", entry.step, value)});
      }
    }
    if (!series.points.empty()) plot.series.push_back(std::move(series));
  }
  if (plot.series.empty()) return std::string();
  return "<h2>Losses</h2>\n" + LogPlotSvg(plot);
}

}  // namespace

Result<std::string> FitReport(const FitJob& job, const FitOutcome& outcome, const ImageU8& sheet) {
  std::string out = kPageHead + Summary(job, outcome);
  TILEGRAD_ASSIGN(const std::string views, Views(job, outcome));
  TILEGRAD_ASSIGN(const std::string curves, Curves(job));
  out += views + curves;
  if (!sheet.empty()) {
    TILEGRAD_ASSIGN(const std::string lapse, Figure(sheet, "the first view, over the run"));
    out += "<h2>Timelapse</h2>\n" + lapse;
  }
  out += Doctor(outcome);
  return out + "<h2>Settings</h2>\n<pre>" + EscapeHtml(DescribeJob(job)) +
         "</pre>\n</body></html>\n";
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_outcome.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "cli/console.h"

namespace tilegrad::cli {
namespace {

void PrintFindings(const std::vector<train::Finding>& findings, bool all) {
  for (const auto& f : findings) {
    if (f.blocked) {
      PrintNote("tilegrad: no gradient for {} at the start: {}\n", train::NameOf(f.parameter),
                f.sentence);
    } else if (all) {
      Print("{}: {}\n", train::NameOf(f.parameter), f.sentence);
    }
  }
}

void PrintScores(const char* name, const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return;
  Print("{}: PSNR {:.2f} dB, silhouette IoU {:.1f} %\n", name, train::MeanPsnr(scores),
        100 * train::MeanIou(scores));
}

void PrintOutcome(const train::FitOutcome& o, const Path& out, std::int64_t steps) {
  const bool early = o.last_step < steps;
  Print("{} in {}{}\n", Count(static_cast<std::size_t>(o.last_step), "step"),
        FormatDuration(o.seconds), early ? ", for more gained nothing (--stop-gain)" : "");
  PrintScores("fitted views", o.training);
  PrintScores("held-out views", o.held_out);
  if (o.voxel_iou) Print("3D IoU at 32 voxels a side: {:.1f} %\n", 100 * *o.voxel_iou);
  if (o.camera_error_before && o.camera_error_after) {
    Print("cameras off by {:.2f} degrees at the start, {:.2f} at the end\n", *o.camera_error_before,
          *o.camera_error_after);
  }
  Print("mesh {}\nlook at {}, or at it forming: tilegrad live {}\n", (out / "mesh.glb").string(),
        (out / "report.html").string(), out.string());
}

nlohmann::ordered_json ScoresJson(const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return nullptr;
  return {{"views", scores.size()},
          {"psnr", train::MeanPsnr(scores)},
          {"silhouette_iou", train::MeanIou(scores)}};
}

void PrintJson(const train::FitOutcome& o, const Path& out) {
  nlohmann::ordered_json json = {{"folder", out.string()},
                                 {"steps", o.last_step},
                                 {"seconds", o.seconds},
                                 {"training", ScoresJson(o.training)},
                                 {"held_out", ScoresJson(o.held_out)},
                                 {"voxel_iou", nullptr},
                                 {"mesh", (out / "mesh.glb").string()},
                                 {"report", (out / "report.html").string()}};
  if (o.voxel_iou) json["voxel_iou"] = *o.voxel_iou;
  PrintResult(json);
}

}  // namespace

void PrintDiagnosis(const std::vector<train::Finding>& findings) {
  PrintFindings(findings, true);
  nlohmann::ordered_json json;
  for (const auto& f : findings)
    json.push_back({{"parameter", train::NameOf(f.parameter)},
                    {"blocked", f.blocked},
                    {"finding", f.sentence}});
  PrintResult(json);
}

void PrintFit(const train::FitOutcome& outcome, const Path& out, std::int64_t steps) {
  PrintFindings(outcome.findings, false);
  PrintOutcome(outcome, out, steps);
  PrintJson(outcome, out);
}

}  // namespace tilegrad::cli

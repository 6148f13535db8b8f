// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/escape_text.h"
#include "io/mesh_file.h"
#include "proof/tradeoff.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "train/config.h"
#include "train/predictor.h"
#include "train/report/log_plot.h"
#include "train/trainer.h"

namespace tilegrad {
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

namespace {

StudyScene SceneOf(std::string name, const Mesh& mesh, int size) {
  StudyScene out;
  out.name = std::move(name);
  out.size = size;
  for (const glm::vec3& p : mesh.positions) {
    for (int i = 0; i < 3; ++i) out.positions.push_back(p[i]);
  }
  for (const Face& face : mesh.faces) out.faces.insert(out.faces.end(), face.begin(), face.end());
  out.camera = OrbitCamera({30.0, size, size}, 40, 25, 2.732);
  return out;
}

void AddBumps(Mesh* mesh) {
  for (glm::vec3& p : mesh->positions) {
    p *= 1 + 0.15f * std::sin(22 * p.x) * std::sin(18 * p.y + 1) * std::sin(20 * p.z + 2);
  }
}

}  // namespace

std::vector<StudyScene> BuiltInScenes() {
  Mesh bumpy = Icosphere(5, 0.5f);
  AddBumps(&bumpy);
  return {SceneOf("sphere", Icosphere(3, 0.5f), 64), SceneOf("bumpy", bumpy, 256)};
}

Result<StudyScene> SceneFromFile(const Path& file, int size) {
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(file));
  TILEGRAD_TRY(NormalizeToBox(loaded.mesh, 0.45f).Within(file.string()));
  return SceneOf(file.stem().string(), loaded.mesh, size);
}

namespace {

Result<StudyTraining> TrainWith(const TrainingStudyJob& study, double error, const Workers& workers,
                                const ProgressSink& progress, const StopFlag& stop) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::FindConfig(study.config));
  TILEGRAD_TRY(
      train::ApplyOverrides({fmt::format("render.max_alpha_error={}", error)}, &job.config));
  job.config.schedule.steps = study.steps;
  job.data = study.data;
  job.run = study.out / fmt::format("training_{:g}", error);
  job.existing = train::ExistingRun::kContinue;
  job.warn = study.warn;
  TILEGRAD_ASSIGN(const train::RunOutcome outcome, train::Train(job, workers, progress, stop));
  TILEGRAD_ASSIGN(const train::Predictor predictor, train::Predictor::Load(job.run, workers));
  TILEGRAD_ASSIGN(
      const train::Evaluation evaluation,
      predictor.task().Evaluate({job.run, study.data, predictor}, workers, progress, stop));
  const train::Score& mean = evaluation.rows.back().mean;
  return StudyTraining{error, outcome.seconds, outcome.last_step, mean.iou,
                       mean.f_score.value_or(0)};
}

}  // namespace

Status CheckTrainingStudy(const TrainingStudyJob& job) {
  if (auto dataset = train::Dataset::Open(job.data); !dataset.ok()) return dataset.status();
  return train::FindConfig(job.config).status();
}

Result<std::vector<StudyTraining>> RunTrainingStudy(const TrainingStudyJob& job,
                                                    const Workers& workers,
                                                    const ProgressSink& progress,
                                                    const StopFlag& stop) {
  std::vector<StudyTraining> out;
  for (const double error : job.errors) {
    TILEGRAD_ASSIGN(out.emplace_back(), TrainWith(job, error, workers, progress, stop));
  }
  return out;
}

}  // namespace tilegrad

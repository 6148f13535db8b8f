// SPDX-License-Identifier: Apache-2.0
#include "proof/tradeoff.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "base/error.h"
#include "base/rng.h"
#include "base/text.h"
#include "io/mesh_file.h"
#include "render/mesh_ref.h"
#include "render/renderer.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "train/config.h"
#include "train/predictor.h"
#include "train/report/html.h"
#include "train/trainer.h"

namespace tilegrad {
namespace {

double CpuMilliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// The naive renderer's result on some rows.
struct Truth {
  std::vector<int> rows;
  std::vector<double> alpha;        // [H,W], of those rows
  std::vector<double> d_positions;  // of L restricted to those rows
  double forward_ms = 0, backward_ms = 0;
};

std::vector<int> SpreadRows(const TradeoffJob& job, std::size_t faces) {
  const double row_pairs = static_cast<double>(job.options.width) * static_cast<double>(faces);
  const int height = job.options.height;
  const auto affordable = std::floor(job.truth_pairs / std::max(row_pairs, 1.0));
  const int count = static_cast<int>(std::clamp(affordable, 1.0, static_cast<double>(height)));
  std::vector<int> rows;
  for (int k = 0; k < count; ++k) {
    rows.push_back(static_cast<int>((k + 0.5) * height / count));
  }
  return rows;
}

class Measurement {
 public:
  Measurement(const TradeoffJob& job, const Watch& watch) : job_(job), watch_(watch) {
    for (const double error : job.errors) settings_.push_back(WithError(error));
    if (job.paper_rule) {
      settings_.push_back(job.options);
      settings_.back().alpha_rule = AlphaRule::kPaper;
    }
    total_ = settings_.size() * static_cast<std::size_t>(job.repetitions + 1);
  }

  Result<Tradeoff> Run() {
    TILEGRAD_TRY(FindIds());
    TILEGRAD_TRY(FindTruth());
    for (const RenderOptions& setting : settings_) TILEGRAD_TRY(AddAccuracy(setting));
    TILEGRAD_TRY(Time());
    out_.faces = job_.scene.faces.size() / 3;
    out_.truth_rows = static_cast<int>(truth_.rows.size());
    out_.image_rows = job_.options.height;
    const double share = static_cast<double>(out_.truth_rows) / out_.image_rows;
    out_.truth_forward_ms = truth_.forward_ms / share;
    out_.truth_backward_ms = truth_.backward_ms / share;
    return std::move(out_);
  }

 private:
  RenderOptions WithError(double error) const {
    RenderOptions options = job_.options;
    options.alpha_rule = AlphaRule::kAllFaces;
    options.max_alpha_error = error;
    return options;
  }
  Status Step(const char* stage, std::size_t done, std::size_t total) {
    if (watch_.stopped()) return Cancelled("stopped");
    watch_.Report({stage, done, total, {}});
    return {};
  }
  std::size_t pixels() const {
    return static_cast<std::size_t>(job_.options.width) *
           static_cast<std::size_t>(job_.options.height);
  }

  Status FindIds();
  Status FindTruth();
  Status AddAccuracy(const RenderOptions& setting);
  Status Time();
  Status Forward(const RenderOptions& setting) {
    return renderer_.Render({&job_.scene, 1}, setting, {.color = false, .attributes = false},
                            &frame_);
  }
  // d_positions_ <- the gradient of L with upstream gradients `d_alpha`, for the last render.
  Status Backward(const std::vector<float>& d_alpha) {
    const SceneGradients d_scene{.positions = d_positions_};
    return renderer_.Backward(frame_, {.alpha = d_alpha}, {&d_scene, 1});
  }

  const TradeoffJob& job_;
  const Watch& watch_;
  const Workers one_{1};
  Renderer renderer_ = RendererOn(one_);
  std::vector<RenderOptions> settings_;
  Frame frame_;
  std::vector<std::int32_t> ids_;
  std::vector<float> d_alpha_, d_alpha_truth_;  // [H,W]; the second only where there is a truth
  std::vector<float> d_positions_;
  Truth truth_;
  Tradeoff out_;
  std::size_t total_ = 0;
};

Status Measurement::FindIds() {
  TILEGRAD_TRY(Step("ids", 0, 1));
  TILEGRAD_TRY(Forward(WithError(0.1)));
  const auto ids = frame_.images().face_ids;
  ids_.assign(ids.begin(), ids.end());
  Rng rng(1, 0);
  d_alpha_.resize(pixels());
  d_alpha_truth_.assign(pixels(), 0.0f);
  for (float& d : d_alpha_) d = static_cast<float>(rng.Uniform(-1, 1));
  truth_.rows = SpreadRows(job_, job_.scene.faces.size() / 3);
  const auto width = static_cast<std::size_t>(job_.options.width);
  for (const int row : truth_.rows) {
    const std::size_t first = static_cast<std::size_t>(row) * width;
    std::copy_n(d_alpha_.begin() + static_cast<std::ptrdiff_t>(first), width,
                d_alpha_truth_.begin() + static_cast<std::ptrdiff_t>(first));
  }
  d_positions_.resize(job_.scene.positions.size());
  return {};
}

Status Measurement::FindTruth() {
  const std::vector<double> positions(job_.scene.positions.begin(), job_.scene.positions.end());
  SceneT<double> scene;
  scene.positions = positions;
  scene.faces = job_.scene.faces;
  scene.camera = CameraCast<double>(job_.scene.camera);
  PreparedScene<double> prepared;
  PrepareRef(scene, {}, job_.options, &prepared);
  PreparedGradients<double> gradients(prepared);
  truth_.alpha.assign(pixels(), 1.0);
  std::size_t done = 0;
  const auto for_background = [&](int row, const auto& visit) {
    const double started = CpuMilliseconds();
    for (int j = 0; j < job_.options.width; ++j) {
      const auto pixel = static_cast<std::size_t>(row * job_.options.width + j);
      if (ids_[pixel] < 0) visit(pixel, j + 0.5, row + 0.5);
    }
    return CpuMilliseconds() - started;
  };
  for (const int row : truth_.rows) {
    TILEGRAD_TRY(Step("truth in float64", done++, truth_.rows.size()));
    truth_.forward_ms += for_background(row, [&](std::size_t pixel, double x, double y) {
      truth_.alpha[pixel] = BackgroundAlphaRef(prepared, job_.options, x, y);
    });
    truth_.backward_ms += for_background(row, [&](std::size_t pixel, double x, double y) {
      const auto d_alpha = static_cast<double>(d_alpha_truth_[pixel]);
      BackgroundAlphaRefBackward(prepared, job_.options, x, y, d_alpha, &gradients);
    });
  }
  truth_.d_positions = PrepareRefBackward(job_.options, prepared, gradients).positions;
  if (Dot(truth_.d_positions, truth_.d_positions) == 0) {
    return InvalidArgument("alpha of this scene has no gradient: nothing is near its background");
  }
  return {};
}

Status Measurement::AddAccuracy(const RenderOptions& setting) {
  TILEGRAD_TRY(Step("measuring", out_.rows.size(), total_));
  TradeoffRow row;
  row.rule = setting.alpha_rule;
  row.max_alpha_error = setting.alpha_rule == AlphaRule::kPaper
                            ? std::numeric_limits<double>::infinity()
                            : setting.max_alpha_error;
  TILEGRAD_TRY(Forward(setting));
  row.reported = frame_.images().alpha_error_bound;
  const std::span<const float> alpha = frame_.images().alpha;
  std::size_t background = 0;
  for (const int y : truth_.rows) {
    for (int x = 0; x < job_.options.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y * job_.options.width + x);
      if (ids_[pixel] >= 0) continue;
      const double off = std::abs(static_cast<double>(alpha[pixel]) - truth_.alpha[pixel]);
      row.largest = std::max(row.largest, off);
      row.mean += off;
      ++background;
    }
  }
  row.mean /= static_cast<double>(std::max<std::size_t>(background, 1));
  TILEGRAD_TRY(Backward(d_alpha_truth_));
  const std::vector<double> d(d_positions_.begin(), d_positions_.end());
  std::vector<double> off = d;
  for (std::size_t i = 0; i < d.size(); ++i) off[i] -= truth_.d_positions[i];
  const double truth = std::sqrt(Dot(truth_.d_positions, truth_.d_positions));
  const double ours = std::sqrt(Dot(d, d));
  row.gradient_error = std::sqrt(Dot(off, off)) / truth;
  // Of the chord between the directions: the arc cosine would lose small angles.
  double chord = 0;
  for (std::size_t i = 0; i < d.size() && ours > 0; ++i) {
    const double part = d[i] / ours - truth_.d_positions[i] / truth;
    chord += part * part;
  }
  const double half = ours > 0 ? std::min(std::sqrt(chord) / 2, 1.0) : std::sqrt(0.5);
  row.gradient_angle = 2 * std::asin(half) * 180 / std::numbers::pi;
  out_.rows.push_back(row);
  return {};
}

Status Measurement::Time() {
  std::vector<std::vector<double>> forward(out_.rows.size()), backward(out_.rows.size());
  std::size_t done = out_.rows.size();
  for (int k = 0; k < job_.repetitions; ++k) {
    for (std::size_t i = 0; i < out_.rows.size(); ++i) {
      TILEGRAD_TRY(Step("measuring", done++, total_));
      const double started = CpuMilliseconds();
      TILEGRAD_TRY(Forward(settings_[i]));
      const double between = CpuMilliseconds();
      TILEGRAD_TRY(Backward(d_alpha_));
      forward[i].push_back(between - started);
      backward[i].push_back(CpuMilliseconds() - between);
    }
  }
  for (std::size_t i = 0; i < out_.rows.size(); ++i) {
    out_.rows[i].forward_ms = Median(forward[i]);
    out_.rows[i].backward_ms = Median(backward[i]);
  }
  return {};
}

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

// Zero has no logarithm: half a unit in the last place of 1 replaces it.
double Shown(double error) { return std::max(error, 0x1p-25); }

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

Result<StudyTraining> TrainWith(const TrainingStudyJob& study, double error, const Workers& workers,
                                const Watch& watch) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::FindConfig(study.config));
  TILEGRAD_TRY(
      train::ApplyOverrides({fmt::format("render.max_alpha_error={}", error)}, &job.config));
  job.config.schedule.steps = study.steps;
  job.data = study.data;
  job.run = study.out / fmt::format("training_{:g}", error);
  job.existing = train::ExistingRun::kContinue;
  job.warn = study.warn;
  TILEGRAD_ASSIGN(const train::RunOutcome outcome, train::Train(job, workers, watch));
  TILEGRAD_ASSIGN(const train::Predictor predictor, train::Predictor::Load(job.run, workers));
  TILEGRAD_ASSIGN(const train::Evaluation evaluation,
                  predictor.task().Evaluate({job.run, study.data, predictor}, workers, watch));
  const train::Score& mean = evaluation.rows.back().mean;
  return StudyTraining{error, outcome.seconds, outcome.last_step, mean.iou,
                       mean.f_score.value_or(0)};
}

}  // namespace

Result<Tradeoff> MeasureTradeoff(const TradeoffJob& job, const Watch& watch) {
  if (job.errors.empty()) return InvalidArgument("no max_alpha_error to try");
  for (const double error : job.errors) {
    if (!(error >= 0 && error <= 1)) {
      return InvalidArgument("max_alpha_error is {}; it must be in [0, 1]", error);
    }
  }
  if (job.repetitions < 1) return InvalidArgument("repetitions is {}; at least 1", job.repetitions);
  return Measurement(job, watch).Run();
}

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
      if (row.rule == AlphaRule::kPaper) continue;  // it is on no curve
      series.points.push_back({std::max(Cost(row), 1e-3), Shown(row.largest),
                               fmt::format("max_alpha_error = {:g}", row.max_alpha_error)});
    }
    plot.series.push_back(std::move(series));
  }
  return train::LogPlotSvg(plot);
}

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

Status CheckTrainingStudy(const TrainingStudyJob& job) {
  if (auto dataset = train::Dataset::Open(job.data); !dataset.ok()) return dataset.status();
  return train::FindConfig(job.config).status();
}

Result<std::vector<StudyTraining>> RunTrainingStudy(const TrainingStudyJob& job,
                                                    const Workers& workers, const Watch& watch) {
  std::vector<StudyTraining> out;
  for (const double error : job.errors) {
    TILEGRAD_ASSIGN(out.emplace_back(), TrainWith(job, error, workers, watch));
  }
  return out;
}

}  // namespace tilegrad

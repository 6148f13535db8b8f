// SPDX-License-Identifier: Apache-2.0
#include "fit/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/folder_lock.h"
#include "fit/pictures.h"
#include "fit/transforms.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "nn/context.h"
#include "train/data/dataset.h"
#include "train/metrics/metrics.h"
#include "train/pictures.h"
#include "train/run/checkpoint.h"
#include "train/run/first_difference.h"
#include "train/run/log.h"

namespace tilegrad::train {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t kLogEvery = 10;
constexpr std::int64_t kKeptCheckpoints = 2;
constexpr int kSheetColumns = 6;

ImageSize SizeOf(const FitInput& input) { return {input.images.width, input.images.height}; }

// The step that a schedule asks for; `targets` are reduced as it says.
FitStep StepOf(const FitConfig& config, const FitSchedule& schedule, const TargetImages& targets,
               std::span<const int> views) {
  FitStep step;
  step.views = views, step.targets = &targets;
  step.job.scale = 1.0f / static_cast<float>(schedule.factor);
  step.job.options.width = targets.width, step.job.options.height = targets.height;
  step.job.options.delta = schedule.delta;
  step.job.options.max_alpha_error = config.max_alpha_error;
  step.rate_factor = schedule.rate;
  return step;
}

// One session of a fit.
class Session {
 public:
  Session(const FitJob& job, const Workers& workers, Fitter fitter)
      : job_(job), workers_(workers), context_(workers), fitter_(std::move(fitter)) {}

  Status Open(FitOutcome* outcome);
  Status Run(const ProgressSink& progress, const StopFlag& stop, FitOutcome* outcome);
  Status Finish(FitOutcome* outcome);

 private:
  const TargetImages& Targets(int factor);
  Status Save();
  Status Log(const FitValues& values, const FitSchedule& schedule);
  bool ShowsAt(std::int64_t step) const;
  Path PictureOf(std::int64_t step) const;
  Status Show();
  Result<ImageU8> Sheet() const;
  Status Score(FitOutcome* outcome) const;
  Status ScoreCameras(const FitScene& start, FitOutcome* outcome) const;
  Status WriteCameras() const;
  double Seconds() const {
    return seconds_before_ + std::chrono::duration<double>(Clock::now() - began_).count();
  }

  const FitJob& job_;
  const Workers& workers_;
  FolderLock lock_;
  nn::Context context_;
  Fitter fitter_;
  std::optional<RunLog> log_;
  std::map<int, TargetImages> targets_;  // by factor
  std::int64_t step_ = 0;                // done
  double seconds_before_ = 0;
  Clock::time_point began_ = Clock::now();
};

Status Session::Open(FitOutcome* outcome) {
  TILEGRAD_ASSIGN(lock_, FolderLock::Take(job_.out));
  RemoveHalfWritten(job_.out);
  if (!ListCheckpoints(job_.out).empty()) {
    if (!job_.resume) {
      return InvalidArgument(
          "{}: already holds a fit; --resume goes on with it, or choose another --out",
          job_.out.string());
    }
    TILEGRAD_ASSIGN(FoundCheckpoint found, LoadNewestCheckpoint(context_, job_.out));
    const CheckpointInfo& info = found.checkpoint.info;
    const std::string difference = FirstDifference(info.config, DescribeJob(job_));
    if (!difference.empty()) {
      return InvalidArgument("{}: its fit was started with other settings: {}", job_.out.string(),
                             difference);
    }
    const Status loaded = fitter_.LoadState(found.checkpoint.tensors);
    if (!loaded.ok()) return loaded.Within(found.file.string());
    SetAside(found.broken);
    step_ = info.step, seconds_before_ = info.seconds;
    for (const auto& warning : found.warnings) {
      if (job_.warn) job_.warn("passed over: " + warning);
    }
  }
  TILEGRAD_ASSIGN(log_, RunLog::Open(job_.out, step_));
  outcome->first_step = step_;
  return {};
}

const TargetImages& Session::Targets(int factor) {
  auto [at, added] = targets_.try_emplace(factor);
  if (added) at->second = Reduce(job_.input.images, factor);
  return at->second;
}

Status Session::Save() {
  const CheckpointInfo info{step_, job_.input.images.width, DescribeJob(job_), Seconds()};
  TILEGRAD_TRY(SaveCheckpoint(job_.out, info, fitter_.State(context_)));
  PruneCheckpoints(job_.out, kKeptCheckpoints);
  return {};
}

Status Session::Log(const FitValues& values, const FitSchedule& schedule) {
  LogEntry entry{step_, {}};
  entry.values = {{"loss", values.total},
                  {"color", values.image.color},
                  {"silhouette", values.image.silhouette},
                  {"laplacian", values.regularizers.laplacian},
                  {"flatness", values.regularizers.flatness},
                  {"edge_length", values.regularizers.edge_length},
                  {"delta", schedule.delta},
                  {"factor", static_cast<double>(schedule.factor)}};
  return log_->Append(entry);
}

// Pictures are spread evenly over the run, the start and the end included.
bool Session::ShowsAt(std::int64_t step) const {
  const std::int64_t count = job_.config.timelapse - 1, steps = job_.config.steps;
  if (job_.config.timelapse <= 0) return false;
  if (step == 0 || step == steps || count <= 0) return step == 0 || step == steps;
  return step * count / steps != (step - 1) * count / steps;
}

Path Session::PictureOf(std::int64_t step) const {
  return job_.out / "timelapse" / fmt::format("{:08}.png", step);
}

Status Session::Show() {
  FitRenderer renderer(workers_);
  FitRenderer::Job job;
  job.views = std::span(job_.input.training).first(1);
  job.alpha = false;
  job.options.width = job_.input.images.width, job.options.height = job_.input.images.height;
  TILEGRAD_TRY(renderer.Render(fitter_.scene(), job));
  return io::SavePng(PictureOf(step_), OverWhite(renderer.images(), 0));
}

Status Session::Run(const ProgressSink& progress, const StopFlag& stop, FitOutcome* outcome) {
  const FitConfig& config = job_.config;
  if (step_ == 0 && ShowsAt(0)) TILEGRAD_TRY(Show());
  while (step_ < config.steps) {
    if (stop) {
      TILEGRAD_TRY(Save());
      return Cancelled("stopped and saved at step {} of {}; the same command with --resume goes on",
                       step_, config.steps);
    }
    const FitSchedule schedule = ScheduleAt(config, step_, SizeOf(job_.input));
    const std::vector<int> views = ViewsAt(config, step_, job_.input.training);
    auto values = fitter_.Step(StepOf(config, schedule, Targets(schedule.factor), views));
    if (!values.ok()) return values.status().Within(fmt::format("step {}", step_));
    ++step_;
    outcome->last = *values;
    if (step_ % kLogEvery == 0) TILEGRAD_TRY(Log(*values, schedule));
    if (ShowsAt(step_)) TILEGRAD_TRY(Show());
    if (step_ % config.checkpoint_every == 0 || step_ == config.steps) TILEGRAD_TRY(Save());
    if (progress) {
      progress({"fitting", static_cast<std::uint64_t>(step_),
                static_cast<std::uint64_t>(config.steps),
                fmt::format("loss {:.4f}", values->total)});
    }
  }
  outcome->last_step = step_;
  outcome->seconds = Seconds();
  return {};
}

// All of this fit in one picture. There may be others in the folder: of a fit that was killed
// before its first checkpoint, so that another could begin here.
Result<ImageU8> Session::Sheet() const {
  std::vector<Path> files;
  std::error_code error;
  for (std::int64_t step = 0; step <= job_.config.steps; ++step) {
    if (ShowsAt(step) && std::filesystem::exists(PictureOf(step), error))
      files.push_back(PictureOf(step));
  }
  if (files.empty()) return ImageU8();
  std::vector<ImageU8> pictures;
  for (const Path& file : files) {
    TILEGRAD_ASSIGN(ImageU8 picture, io::LoadImage(file));
    if (picture.width != job_.input.images.width || picture.channels != 3) continue;
    pictures.push_back(std::move(picture));
  }
  return TileImages(pictures, kSheetColumns);
}

Status Session::WriteCameras() const {
  std::vector<TransformsView> views;
  for (std::size_t i = 0; i < job_.input.names.size(); ++i) {
    views.push_back({job_.input.names[i], fitter_.scene().cameras[i]});
  }
  return WriteTextAtomic(job_.out / "transforms_fitted.json",
                         WriteTransforms(views, SizeOf(job_.input)));
}

std::vector<Camera> Choose(std::span<const Camera> cameras, std::span<const int> views) {
  std::vector<Camera> out;
  for (const int v : views) out.push_back(cameras[static_cast<std::size_t>(v)]);
  return out;
}

double MeanAngle(std::span<const Camera> a, std::span<const Camera> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += AngleBetween(a[i], b[i]);
  return a.empty() ? 0 : sum / static_cast<double>(a.size());
}

Status Session::ScoreCameras(const FitScene& start, FitOutcome* outcome) const {
  if (job_.config.perturb_cameras == 0) return {};
  const std::vector<int>& views = job_.input.training;
  const std::vector<Camera> truth = Choose(job_.input.cameras, views);
  outcome->camera_error_before = MeanAngle(Choose(start.cameras, views), truth);
  std::vector<Camera> fitted = Choose(fitter_.scene().cameras, views);
  const Alignment alignment = AlignCameras(fitted, truth);
  for (Camera& camera : fitted) camera = Moved(camera, alignment);
  outcome->camera_error_after = MeanAngle(fitted, truth);
  return {};
}

Status Session::Score(FitOutcome* outcome) const {
  const FitInput& input = job_.input;
  const std::vector<Camera> fitted = Choose(fitter_.scene().cameras, input.training);
  TILEGRAD_ASSIGN(outcome->training,
                  ScoreViews(fitter_.scene(), input, input.training, fitted, workers_));
  // Cameras that moved fix the scene only up to a similarity; held-out ones did not move.
  FitScene scene = fitter_.scene();
  if (job_.config.parameters[Parameter::kCamera]) {
    Move(AlignCameras(fitted, Choose(input.cameras, input.training)), &scene.positions);
  }
  TILEGRAD_ASSIGN(outcome->held_out, ScoreViews(scene, input, input.held_out,
                                                Choose(input.cameras, input.held_out), workers_));
  std::vector<std::uint8_t> truth = input.occupancy;
  if (job_.truth.has_value()) {
    TILEGRAD_ASSIGN(truth, Voxelize(*job_.truth, kOccupancyResolution));
  }
  if (truth.empty()) return {};
  TILEGRAD_ASSIGN(const auto voxels, Voxelize(MeshOfScene(scene), kOccupancyResolution));
  outcome->voxel_iou = VoxelIou(voxels, truth);
  return {};
}

Status Session::Finish(FitOutcome* outcome) {
  TILEGRAD_TRY(io::SaveGlb(job_.out / "mesh.glb", MeshOfScene(fitter_.scene())));
  TILEGRAD_TRY(WriteCameras());
  TILEGRAD_ASSIGN(const FitStart start, PrepareFit(job_));
  TILEGRAD_TRY(ScoreCameras(start.scene, outcome));
  TILEGRAD_TRY(Score(outcome));
  TILEGRAD_ASSIGN(const ImageU8 sheet, Sheet());
  if (!sheet.empty()) TILEGRAD_TRY(io::SavePng(job_.out / "timelapse.png", sheet));
  TILEGRAD_ASSIGN(const std::string page, FitReport(job_, *outcome, sheet));
  return WriteTextAtomic(job_.out / "report.html", page);
}

}  // namespace

double MeanPsnr(std::span<const ViewScore> scores) {
  double sum = 0;
  for (const ViewScore& s : scores) sum += s.psnr / static_cast<double>(scores.size());
  return sum;
}

double MeanIou(std::span<const ViewScore> scores) {
  double sum = 0;
  for (const ViewScore& s : scores) sum += s.iou / static_cast<double>(scores.size());
  return sum;
}

Result<std::vector<Finding>> DiagnoseFit(const FitJob& job, const Workers& workers) {
  TILEGRAD_ASSIGN(const FitStart start, PrepareFit(job));
  const FitSchedule schedule = ScheduleAt(job.config, 0, SizeOf(job.input));
  const TargetImages targets = Reduce(job.input.images, schedule.factor);
  return Diagnose(start.scene, start.options,
                  StepOf(job.config, schedule, targets, job.input.training), workers);
}

Result<FitOutcome> RunFit(const FitJob& job, const Workers& workers, const ProgressSink& progress,
                          const StopFlag& stop) {
  FitOutcome outcome;
  TILEGRAD_ASSIGN(outcome.findings, DiagnoseFit(job, workers));
  TILEGRAD_ASSIGN(FitStart start, PrepareFit(job));
  TILEGRAD_ASSIGN(Fitter fitter, Fitter::Make(std::move(start.scene), start.options, workers));
  Session session(job, workers, std::move(fitter));
  TILEGRAD_TRY(session.Open(&outcome));
  TILEGRAD_TRY(session.Run(progress, stop, &outcome));
  TILEGRAD_TRY(session.Finish(&outcome));
  return outcome;
}

}  // namespace tilegrad::train

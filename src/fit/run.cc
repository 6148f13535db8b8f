// SPDX-License-Identifier: Apache-2.0
#include "fit/run.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "fit/clock.h"
#include "fit/cutout.h"
#include "fit/frames.h"
#include "fit/hull/mask_distance.h"
#include "fit/image_loss.h"
#include "fit/material.h"
#include "fit/quarter_turn.h"
#include "fit/texture_fill.h"
#include "io/image_file.h"
#include "nn/context.h"
#include "render/picture/composite.h"
#include "scene/shrink_image.h"
#include "train/data/dataset.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

// A soft silhouette (equation 5) reaches beyond its shape: held to a mask as it is, a shape comes
// out too small, by about the softness on each side, which is much of a chair's leg. So it is held
// to what the true shape's would be: 1 inside of the mask's outline, exp(-d^2 / delta) at a
// distance d outside.
class SoftTargets {
 public:
  SoftTargets(TargetImages images, const Workers& workers)
      : images_(std::move(images)), distances_(images_.alpha.size() / images_.pixels()) {
    images_.silhouette = AlignedVector<float>(images_.outline());
    workers.For(distances_.size(), [&](std::size_t v, std::size_t) {
      const std::size_t plane = images_.pixels();
      distances_[v] = DistanceOf(std::span(images_.silhouette).subspan(v * plane, plane),
                                 images_.width, images_.height);
    });
  }

  // The images, with `silhouette` set for these views. delta in squared NDC. Allocates nothing.
  const TargetImages& At(double delta, std::span<const int> views, const Workers& workers) {
    const double ndc = 2.0 / std::max(images_.width, images_.height);
    const auto factor = static_cast<float>(ndc * ndc / delta);
    workers.For(views.size(), [&](std::size_t i, std::size_t) {
      const auto v = static_cast<std::size_t>(views[i]);
      const std::vector<float>& d = distances_[v].values;
      float* to = &images_.silhouette[v * images_.pixels()];
      for (std::size_t p = 0; p < d.size(); ++p)
        to[p] = d[p] >= 0 ? 1.0f : std::exp(-d[p] * d[p] * factor);
    });
    return images_;
  }

 private:
  TargetImages images_;
  std::vector<MaskDistance> distances_;  // of each view
};

constexpr std::int64_t kLogEvery = 10;
constexpr const char* kInput = "input = ";
constexpr std::int64_t kKeptCheckpoints = 2;
constexpr int kPictureTexels = 512;  // a side: there is a texture for each picture

ImageSize SizeOf(const FitInput& input) { return {input.images.width, input.images.height}; }

// The step that a schedule asks for; `targets` are reduced as it says.
FitStep StepOf(const FitConfig& config, const FitSchedule& schedule, const TargetImages& targets,
               std::span<const int> views) {
  FitStep step;
  step.views = views;
  step.targets = &targets;
  step.job.scale = 1.0f / static_cast<float>(schedule.factor);
  step.job.options.width = targets.width;
  step.job.options.height = targets.height;
  step.job.options.delta = schedule.delta;
  step.job.options.max_alpha_error = config.max_alpha_error;
  step.rate_factor = step.area_factor = schedule.rate;
  step.camera_factor = schedule.camera_rate;
  step.position_factor = schedule.position_rate;
  step.texture_factor = schedule.texture_rate;
  step.light_factor = schedule.light_rate;
  return step;
}

RunPlan PlanOf(const FitJob& job) {
  RunPlan plan{.stage = "fitting",
               .folder = job.out,
               .settings = DescribeJob(job),
               .pictures = "timelapse/",
               .image_size = job.input.images.width,
               .existing = job.existing,
               .may_differ = "steps",  // only more of them: FitClock::LoadState
               .locked = job.locked,
               .warn = job.warn};
  plan.schedule = {.steps = job.config.steps,
                   .seed = job.config.seed,
                   .log_every = kLogEvery,
                   .checkpoint_every = job.config.checkpoint_every,
                   .keep_checkpoints = kKeptCheckpoints};
  return plan;
}

// Lines of a fit's settings that do not count: numbers that are 0, which stands for what fits did
// before they had such a setting, and what is always so since they have it no longer.
bool SaysNothing(const std::string& line) {
  static const std::set<std::string> always = {"color_region = 1", "silhouette_loss = 2"};
  return line.ends_with(" = 0") || always.contains(line);
}

class FitWork : public RunWork {
 public:
  FitWork(const FitJob& job, const FitStart& start, nn::Context& context, Fitter& fitter)
      : job_(job), config_(start.config), context_(context), fitter_(fitter), clock_(config_) {}

  // In no order, which differed in earlier versions. Of what is read, a checksum counts.
  Result<std::string> ResultSettings(const std::string& settings,
                                     const std::string& /*place*/) const override {
    std::istringstream text(settings);
    std::set<std::string> lines;
    for (std::string line; std::getline(text, line);) {
      if (SaysNothing(line)) continue;
      const bool input = line.starts_with(kInput);
      lines.insert(input ? "checksum of images, cameras and mesh" + line.substr(5) : line);
    }
    return fmt::format("{}\n", fmt::join(lines, "\n"));
  }
  Status Begin(std::int64_t /*first_step*/) override {
    return job_.begun ? job_.begun() : Status();
  }

  Status Step(std::int64_t step, StepValues* values) override {
    const FitConfig& config = config_;
    const double time = clock_.At(step);
    const FitSchedule schedule = ScheduleAt(config, time, SizeOf(job_.input));
    const std::vector<int> views = ViewsAt(config, step, job_.input.training);
    TILEGRAD_ASSIGN(FitValues v,
                    fitter_.Step(StepOf(config, schedule, Targets(schedule, views), views)));
    clock_.Note(step, v.image_loss);
    *values = std::move(v);
    values->also = {{"delta", schedule.delta}, {"factor", static_cast<double>(schedule.factor)}};
    values->images = static_cast<std::int64_t>(views.size());
    return {};
  }

  std::vector<nn::NamedTensor> State() override {
    std::vector<nn::NamedTensor> state = fitter_.State();
    for (auto& tensor : clock_.State(context_)) state.push_back(std::move(tensor));
    return state;
  }
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override {
    TILEGRAD_TRY(clock_.LoadState(state, steps));
    return fitter_.LoadState(state);
  }
  std::int64_t End(std::int64_t /*scheduled*/) const override { return clock_.End(); }
  bool HasPicture(std::int64_t steps) const override {
    return ShowsAt(job_.config, steps) || (config_.timelapse > 0 && steps == clock_.End());
  }

  Result<ImageU8> Picture(std::int64_t /*steps*/) override {
    FitRenderer renderer(context_.workers());
    FitRenderer::Job job;
    job.views = std::span(job_.input.training).first(1);
    job.alpha = false;
    job.options.width = job_.input.images.width;
    job.options.height = job_.input.images.height;
    TILEGRAD_TRY(renderer.Render(fitter_.scene(), job));
    return OverGrey(renderer.images(), 0, kWhite);
  }

  Mesh PictureMesh() const override {
    Mesh mesh = MeshOfScene(fitter_.scene());
    for (MeshTexture& texture : mesh.textures)
      texture.image = ShrunkImage(texture.image, kPictureTexels);
    return mesh;
  }

  const FitScene& scene() const { return fitter_.scene(); }
  const FitClock& clock() const { return clock_; }

 private:
  // What views are held to at a schedule's resolution and softness.
  const TargetImages& Targets(const FitSchedule& schedule, std::span<const int> views) {
    auto at = targets_.find(schedule.factor);
    if (at == targets_.end()) {
      at = targets_
               .emplace(schedule.factor,
                        SoftTargets(Reduce(job_.input.images, schedule.factor), context_.workers()))
               .first;
    }
    return at->second.At(schedule.delta, views, context_.workers());
  }

  const FitJob& job_;
  const FitConfig config_;
  nn::Context& context_;
  Fitter& fitter_;
  FitClock clock_;
  std::map<int, SoftTargets> targets_;  // by factor
};

// A texture that began blank has no colour where no view looked. One of the user's keeps his there.
Status FillTexture(const FitJob& job, const Workers& workers, FitScene* scene) {
  const bool blank = !job.start.has_value() || job.start->textures.empty();
  if (!blank || scene->texture.empty()) return {};
  TILEGRAD_ASSIGN(const std::vector<bool> seen,
                  SeenTexels(*scene, job.input.training, SizeOf(job.input), workers));
  FillUnseenTexels(seen, scene);
  return {};
}

Result<std::vector<Finding>> DiagnoseStart(const FitJob& job, const FitStart& start,
                                           const Workers& workers) {
  const FitSchedule schedule = ScheduleAt(start.config, 0, SizeOf(job.input));
  const TargetImages targets = Reduce(job.input.images, schedule.factor);
  return Diagnose(start.scene, start.options,
                  StepOf(start.config, schedule, targets, job.input.training), workers);
}
}  // namespace

Result<std::vector<Finding>> DiagnoseFit(const FitJob& job, const Workers& workers,
                                         const Watch& watch) {
  TILEGRAD_ASSIGN(const FitStart start, PrepareFit(job, workers, watch));
  TILEGRAD_TRY(watch.At({"checking gradients", 0, 0, ""}));
  return DiagnoseStart(job, start, workers);
}

Result<FitOutcome> RunFit(const FitJob& asked, const Workers& workers, const ProgressSink& progress,
                          const StopFlag& stop) {
  FitOutcome outcome;
  const std::optional<FitJob> cutout = CutoutJob(asked, workers);
  const FitJob& job = cutout ? *cutout : asked;
  const Watch watch{progress, &stop};
  TILEGRAD_TRY(CheckExistingRun(job.out, job.existing));  // before the work
  TILEGRAD_ASSIGN(FitStart start, PrepareFit(job, workers, watch));
  if (!start.note.empty() && job.warn) job.warn(start.note);
  TILEGRAD_TRY(watch.At({"checking gradients", 0, 0, ""}));
  TILEGRAD_ASSIGN(outcome.findings, DiagnoseStart(job, start, workers));
  TILEGRAD_ASSIGN(const auto fitter, Fitter::Make(std::move(start.scene), start.options, workers));
  nn::Context context(workers);
  FitWork work(job, start, context, *fitter);
  const RunPlan plan = PlanOf(job);
  TILEGRAD_ASSIGN(static_cast<RunOutcome&>(outcome), ExecuteRun(plan, &work, context, watch));
  FitScene scene = work.scene();
  if (progress) progress({"filling the texture", 0, 0, ""});
  TILEGRAD_TRY(FillTexture(job, workers, &scene));
  if (cutout) TILEGRAD_TRY(FitCutout(job, workers, watch, &scene));
  TILEGRAD_TRY(FitResult(job, scene, work.clock(), workers, watch).Finish(plan, &outcome));
  return outcome;
}

namespace {

double MeanAngle(std::span<const Camera> a, std::span<const Camera> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += AngleBetween(a[i], b[i]);
  return a.empty() ? 0 : sum / static_cast<double>(a.size());
}

std::vector<Camera> Choose(std::span<const Camera> cameras, std::span<const int> views) {
  std::vector<Camera> out;
  for (const int v : views) out.push_back(cameras[static_cast<std::size_t>(v)]);
  return out;
}

// Cameras as the input gave them; those that were found live in a world of their own.
const std::vector<Camera>& GivenCameras(const FitInput& input) {
  return input.given_cameras.empty() ? input.cameras : input.given_cameras;
}

// camera_error_before and _after of the training views, where cameras were turned or found although
// they were given; both after alignment, where that is free.
void ScoreCameras(const FitJob& job, const FitScene& scene, FitOutcome* outcome) {
  const bool found = !job.input.given_cameras.empty();
  if (job.config.perturb_cameras == 0 && !found) return;
  const std::vector<int>& views = job.input.training;
  const std::vector<Camera> truth = Choose(GivenCameras(job.input), views);
  std::vector<Camera> before = Choose(TurnedCameras(job, scene.pivot), views);
  const Similarity first = found ? AlignCameras(before, truth) : Similarity();
  for (Camera& camera : before) camera = Moved(camera, first);
  outcome->camera_error_before = MeanAngle(before, truth);
  std::vector<Camera> fitted = Choose(scene.cameras, views);
  const Similarity alignment = AlignCameras(fitted, truth);
  for (Camera& camera : fitted) camera = Moved(camera, alignment);
  outcome->camera_error_after = MeanAngle(fitted, truth);
}

constexpr int kSheetColumns = 6;

}  // namespace

// All of this fit in one picture. There may be others in the folder: of a fit that was killed
// before its first checkpoint, so that another could begin here. Those of before it got more steps
// are its own.
Result<ImageU8> FitResult::Sheet(const RunPlan& plan) const {
  std::vector<ImageU8> pictures;
  for (std::int64_t step = 0; step <= clock_.End(); ++step) {
    const bool own =
        ShowsAt(job_.config, step) || step <= clock_.extended_at() || step == clock_.End();
    const Path file = PictureFile(plan, step);
    if (!own || !PathExists(file)) continue;
    TILEGRAD_ASSIGN(ImageU8 picture, io::LoadImage(file));
    if (picture.width != job_.input.images.width || picture.channels != 3) continue;
    pictures.push_back(std::move(picture));
  }
  return pictures.empty() ? ImageU8() : TileImages(pictures, kSheetColumns);
}

Status FitResult::WriteCameras() const {
  std::vector<OutputFrame> views;
  const FitInput& input = job_.input;
  const std::vector<Camera> held = HeldCameras(input, scene_.cameras);
  for (std::size_t i = 0; i < input.names.size(); ++i) {
    const double gain = scene_.gains.empty() ? 1.0 : static_cast<double>(scene_.gains[i]);
    views.push_back({input.names[i], held[i], gain});
  }
  const ImageSize size = SizeOf(input), across = {size.height, size.width};
  for (const int i : input.turned) views[static_cast<std::size_t>(i)].size = across;
  return WriteTextAtomic(job_.out / "transforms_fitted.json", WriteTransforms(views, size));
}

Status FitResult::Score(FitOutcome* outcome) const {
  const FitInput& input = job_.input;
  const std::vector<Camera> fitted = Choose(scene_.cameras, input.training);
  TILEGRAD_ASSIGN(outcome->training,
                  ScoreViews(scene_, input, input.training, fitted, workers_, watch_));
  outcome->doubt = DoubtOf(outcome->training, input);
  // Cameras that moved fix the scene only up to a similarity; held-out ones did not move.
  FitScene scene = scene_;
  const std::vector<Camera>& given = GivenCameras(input);
  if (job_.config.parameters[Parameter::kCamera] || input.found) {
    Move(AlignCameras(fitted, Choose(given, input.training)), &scene.positions);
  }
  TILEGRAD_ASSIGN(outcome->held_out, ScoreViews(scene, input, input.held_out,
                                                Choose(given, input.held_out), workers_, watch_));
  std::vector<std::uint8_t> truth = input.occupancy;
  if (job_.truth.has_value()) {
    TILEGRAD_ASSIGN(truth, Voxelize(*job_.truth, kOccupancyResolution));
  }
  if (truth.empty()) return {};
  TILEGRAD_ASSIGN(const auto voxels, Voxelize(MeshOfScene(scene), kOccupancyResolution));
  outcome->voxel_iou = VoxelIou(voxels, truth);
  return {};
}

Status FitResult::Finish(const RunPlan& plan, FitOutcome* outcome) const {
  TILEGRAD_TRY(SaveFittedGlb(job_.out / "mesh.glb", scene_));
  TILEGRAD_TRY(WriteCameras());
  ScoreCameras(job_, scene_, outcome);
  TILEGRAD_TRY(Score(outcome));
  TILEGRAD_ASSIGN(const ImageU8 sheet, Sheet(plan));
  if (!sheet.empty()) TILEGRAD_TRY(io::SavePng(job_.out / "timelapse.png", sheet));
  TILEGRAD_ASSIGN(const std::string page, FitReport(job_, *outcome, MeshOfScene(scene_), sheet));
  return WriteTextAtomic(job_.out / "report.html", page);
}

}  // namespace tilegrad::train

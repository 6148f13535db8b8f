// SPDX-License-Identifier: Apache-2.0
#include "fit/result.h"

#include <span>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "fit/material.h"
#include "fit/run.h"
#include "fit/transforms.h"
#include "io/image_file.h"
#include "render/picture/composite.h"
#include "train/data/dataset.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
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
  std::vector<TransformsView> views;
  for (std::size_t i = 0; i < job_.input.names.size(); ++i) {
    const double gain = scene_.gains.empty() ? 1.0 : static_cast<double>(scene_.gains[i]);
    views.push_back({job_.input.names[i], scene_.cameras[i], gain});
  }
  return WriteTextAtomic(
      job_.out / "transforms_fitted.json",
      WriteTransforms(views, {job_.input.images.width, job_.input.images.height}));
}

Status FitResult::Score(FitOutcome* outcome) const {
  const FitInput& input = job_.input;
  const std::vector<Camera> fitted = Choose(scene_.cameras, input.training);
  TILEGRAD_ASSIGN(outcome->training,
                  ScoreViews(scene_, input, input.training, fitted, workers_, watch_));
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

// SPDX-License-Identifier: Apache-2.0
#include "fit/camera_score.h"

namespace tilegrad::train {
namespace {

double MeanAngle(std::span<const Camera> a, std::span<const Camera> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += AngleBetween(a[i], b[i]);
  return a.empty() ? 0 : sum / static_cast<double>(a.size());
}

}  // namespace

std::vector<Camera> Choose(std::span<const Camera> cameras, std::span<const int> views) {
  std::vector<Camera> out;
  for (const int v : views) out.push_back(cameras[static_cast<std::size_t>(v)]);
  return out;
}

const std::vector<Camera>& GivenCameras(const FitInput& input) {
  return input.given_cameras.empty() ? input.cameras : input.given_cameras;
}

void ScoreCameras(const FitJob& job, const FitScene& scene, FitOutcome* outcome) {
  const bool found = !job.input.given_cameras.empty();
  if (job.config.perturb_cameras == 0 && !found) return;
  const std::vector<int>& views = job.input.training;
  const std::vector<Camera> truth = Choose(GivenCameras(job.input), views);
  std::vector<Camera> before = Choose(TurnedCameras(job, scene.pivot), views);
  const Alignment first = found ? AlignCameras(before, truth) : Alignment();
  for (Camera& camera : before) camera = Moved(camera, first);
  outcome->camera_error_before = MeanAngle(before, truth);
  std::vector<Camera> fitted = Choose(scene.cameras, views);
  const Alignment alignment = AlignCameras(fitted, truth);
  for (Camera& camera : fitted) camera = Moved(camera, alignment);
  outcome->camera_error_after = MeanAngle(fitted, truth);
}

}  // namespace tilegrad::train

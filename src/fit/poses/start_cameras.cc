// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/start_cameras.h"

#include "base/error.h"
#include "fit/masks/start_masks.h"
#include "fit/poses/input_poses.h"
#include "fit/poses/view_gap.h"
#include "fit/sphere.h"

namespace tilegrad::train {
namespace {

// Of the steps; the best of a few on a van and a cat whose cameras were 2 degrees off.
constexpr double kCamerasRest = 0.4;
// Degrees between a direction and the nearest camera. Two rings of twelve cameras leave 25.
constexpr double kWideGap = 30;

// Nothing to note where masks do not locate the object.
void NoteWidestGap(FitInput* input) {
  const auto sphere = GuessSphere(*input);
  if (!sphere.ok()) return;
  const ViewGap gap = WidestGap(input->cameras, sphere->centre);
  input->notes.push_back(
      gap.degrees < kWideGap
          ? fmt::format("views: all around, every direction is within {:.0f} degrees of one",
                        kWideGap)
          : fmt::format("views: one more picture would help most {}",
                        DescribePlace(gap, input->names[gap.nearest])));
}

}  // namespace

Status StartCameras(const CameraSearch& search, FitJob* job, const Workers& workers,
                    const ProgressSink& progress, const StopFlag& stop) {
  if (!search.look) TILEGRAD_TRY(StartMasks(search.resume, job, workers, {progress, &stop}));
  InputPosesJob find;
  find.options.seed = job->config.seed;
  if (!job->out.empty()) find.file = job->out / "cameras_start.json";
  find.reuse = search.resume;
  const bool shaped = job->start.has_value();
  if (!job->input.posed || search.look) {
    TILEGRAD_TRY(FindInputPoses(find, &job->input, workers, progress, stop));
  } else if (job->config.parameters[Parameter::kCamera] && !shaped && job->input.masked) {
    TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(job->input));
    const std::array<float, 3> middle = {sphere.centre.x, sphere.centre.y, sphere.centre.z};
    TILEGRAD_ASSIGN(job->start_cameras,
                    RefineInputPoses(find, job->input, TurnedCameras(*job, middle), workers,
                                     {progress, &stop}));
  }
  if (!shaped) job->config.cameras_rest = kCamerasRest;
  NoteWidestGap(&job->input);
  return {};
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_pictures.h"

#include <algorithm>
#include <map>

#include "base/error.h"
#include "cli/console.h"
#include "fit/poses/input_poses.h"

namespace tilegrad::cli {
namespace {

// Of the steps; the best of a few on a van and a cat whose cameras were 2 degrees off.
constexpr double kCamerasRest = 0.4;

}  // namespace

train::InputOptions InputOptionsOf(const FitPictures& pictures, int hold_out) {
  static const std::map<std::string, train::Background> backgrounds = {
      {"auto", train::Background::kAuto},
      {"mask", train::Background::kMask},
      {"plain", train::Background::kPlain},
      {"none", train::Background::kNone}};
  return {hold_out, backgrounds.at(pictures.background), pictures.fov};
}

void PrintWarnings(const train::FitInput& input, std::size_t first) {
  constexpr std::size_t kShown = 3;
  const std::size_t count = input.warnings.size() - first;
  for (std::size_t i = 0; i < std::min(count, kShown); ++i) {
    PrintNote("tilegrad: warning: {}\n", input.warnings[first + i]);
  }
  if (count > kShown) PrintNote("tilegrad: warning: and {} more of these\n", count - kShown);
}

Status StartCameras(const CameraSearch& search, train::FitJob* job, const Workers& workers,
                    const ProgressSink& progress) {
  train::InputPosesJob find;
  find.options.seed = job->config.seed;
  find.file = job->out / "cameras_start.json";
  find.guard = job->guard, find.reuse = search.resume;
  const bool unknown = !job->input.posed || search.pictures.find_cameras;
  const bool shaped = job->start.has_value();
  if (unknown) {
    const std::size_t before = job->input.warnings.size();
    TILEGRAD_TRY(train::FindInputPoses(find, &job->input, workers, progress, StopOnSignals()));
    PrintWarnings(job->input, before);
  } else if (job->config.parameters[train::Parameter::kCamera] && !shaped && job->input.masked) {
    if (progress) progress({"refining cameras", 0, 0, ""});
    TILEGRAD_ASSIGN(const train::Sphere sphere, train::GuessSphere(job->input));
    const std::array<float, 3> middle = {sphere.centre.x, sphere.centre.y, sphere.centre.z};
    TILEGRAD_ASSIGN(
        job->start_cameras,
        train::RefineInputPoses(find, job->input, train::TurnedCameras(*job, middle), workers));
  }
  if (!shaped) job->config.cameras_rest = kCamerasRest;
  return {};
}

void AddPictureOptions(CLI::App* command, FitPictures* o) {
  command
      ->add_option("--background", o->background,
                   "where masks come from: the images' alpha or masks (mask), their plain "
                   "backgrounds (plain), the former if there are any (auto); none: every pixel "
                   "shows the object")
      ->check(CLI::IsMember({"auto", "mask", "plain", "none"}))
      ->capture_default_str();
  command->add_flag("--find-cameras", o->find_cameras,
                    "look for the cameras in the images, though the folder has some; these judge "
                    "the result");
  command
      ->add_option("--fov", o->fov,
                   "degrees that images without cameras see along their longer side")
      ->check(CLI::Range(5.0, 150.0))
      ->capture_default_str();
}

}  // namespace tilegrad::cli

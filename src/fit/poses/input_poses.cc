// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/input_poses.h"

#include <algorithm>
#include <numeric>

#include "base/file.h"
#include "fit/score.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::json;

constexpr double kDoubt = 20;  // degrees between the two best starts
constexpr std::size_t kNumbers = 12;

TargetImages Chosen(const TargetImages& images, std::span<const int> views) {
  TargetImages out;
  out.width = images.width, out.height = images.height;
  for (const int v : views) {
    const auto n = static_cast<std::size_t>(v);
    const auto color =
        std::span(images.color).subspan(3 * n * images.pixels(), 3 * images.pixels());
    const auto alpha = std::span(images.alpha).subspan(n * images.pixels(), images.pixels());
    out.color.insert(out.color.end(), color.begin(), color.end());
    out.alpha.insert(out.alpha.end(), alpha.begin(), alpha.end());
  }
  return out;
}

std::vector<Camera> Chosen(std::span<const Camera> cameras, std::span<const int> views) {
  std::vector<Camera> out;
  for (const int v : views) out.push_back(cameras[static_cast<std::size_t>(v)]);
  return out;
}

// Floats survive as decimal numbers of 9 digits.
std::string TextOf(const FoundPoses& found) {
  Json poses = Json::array();
  for (const Camera& c : found.cameras) {
    std::vector<double> numbers(c.rotation, c.rotation + 9);
    numbers.insert(numbers.end(), c.translation, c.translation + 3);
    poses.push_back(numbers);
  }
  const Json file = {{"agreement", found.agreement}, {"loss", found.loss}, {"poses", poses}};
  return file.dump(1) + "\n";
}

Status ReadPoses(const Path& path, std::span<const Camera> lenses, FoundPoses* out) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  TILEGRAD_ASSIGN(const Json file, ParseJson(text, path.string()));
  const auto bad = [&] {
    return DataLoss("{}: does not hold {} poses of twelve numbers; remove it to look for them anew",
                    path.string(), lenses.size());
  };
  if (!file.is_object() || !file.contains("poses") || !file["poses"].is_array() ||
      file["poses"].size() != lenses.size() || !file.value("agreement", Json()).is_number()) {
    return bad();
  }
  out->agreement = file["agreement"].get<double>();
  out->cameras.assign(lenses.begin(), lenses.end());
  for (std::size_t i = 0; i < lenses.size(); ++i) {
    const Json& pose = file["poses"][i];
    if (!pose.is_array() || pose.size() != kNumbers) return bad();
    for (std::size_t k = 0; k < kNumbers; ++k) {
      if (!pose[k].is_number()) return bad();
      Camera& camera = out->cameras[i];
      (k < 9 ? camera.rotation[k] : camera.translation[k - 9]) = pose[k].get<float>();
    }
  }
  return {};
}

Status Keep(const InputPosesJob& job, const FoundPoses& found) {
  return job.file.empty() ? Status() : WriteTextAtomic(job.file, TextOf(found));
}

// Held-out cameras were given in another world.
void MoveHeldOut(const std::vector<Camera>& given, FitInput* input) {
  const Alignment alignment =
      AlignCameras(Chosen(given, input->training), Chosen(input->cameras, input->training));
  for (const int i : input->held_out) {
    Camera& camera = input->cameras[static_cast<std::size_t>(i)];
    camera = Moved(camera, alignment);
  }
}

}  // namespace

Status FindInputPoses(const InputPosesJob& job, FitInput* input, const Workers& workers,
                      const ProgressSink& progress, const StopFlag& stop) {
  if (!input->masked) {
    return InvalidArgument(
        "no image says where the object is, without which cameras cannot be found: give images "
        "with alpha, masks, or a plain background");
  }
  std::vector<int> views = input->training;
  if (!input->posed) views.resize(input->names.size()), std::iota(views.begin(), views.end(), 0);
  const std::vector<Camera> lenses = Chosen(input->cameras, views);
  FoundPoses found;
  if (job.reuse && PathExists(job.file)) {
    TILEGRAD_TRY(ReadPoses(job.file, lenses, &found));
  } else {
    TILEGRAD_ASSIGN(found, FindPoses(Chosen(input->images, views), lenses, job.options, workers,
                                     progress, stop));
    TILEGRAD_TRY(Keep(job, found));
  }
  const std::vector<Camera> given = input->cameras;
  for (std::size_t i = 0; i < views.size(); ++i) {
    input->cameras[static_cast<std::size_t>(views[i])] = found.cameras[i];
  }
  if (input->posed) {
    MoveHeldOut(given, input);
    input->given_cameras = given;
  }
  input->found = true;
  if (found.agreement > kDoubt) {
    input->warnings.push_back(fmt::format(
        "the cameras that were found are in doubt: the two best of the searches differ by {:.0f} "
        "degrees. Objects that look alike from several sides need cameras from another program",
        found.agreement));
  }
  return {};
}

Result<std::vector<Camera>> RefineInputPoses(const InputPosesJob& job, const FitInput& input,
                                             std::span<const Camera> cameras,
                                             const Workers& workers) {
  const std::vector<Camera> from = Chosen(cameras, input.training);
  FoundPoses refined;
  refined.agreement = 0;
  if (job.reuse && PathExists(job.file)) {
    TILEGRAD_TRY(ReadPoses(job.file, from, &refined));
  } else {
    TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(input));
    Alignment shrink;
    shrink.scale = 0.5 / static_cast<double>(sphere.radius);
    for (int i = 0; i < 3; ++i) {
      shrink.offset[i] = -shrink.scale * static_cast<double>(sphere.centre[i]);
    }
    std::vector<Camera> near = from;
    for (Camera& camera : near) camera = Moved(camera, shrink);
    TILEGRAD_ASSIGN(refined.cameras,
                    RefinePoses(Chosen(input.images, input.training), near, workers));
    const Alignment back = AlignCameras(refined.cameras, from);
    for (Camera& camera : refined.cameras) camera = Moved(camera, back);
    TILEGRAD_TRY(Keep(job, refined));
  }
  std::vector<Camera> out(cameras.begin(), cameras.end());
  for (std::size_t i = 0; i < from.size(); ++i) {
    out[static_cast<std::size_t>(input.training[i])] = refined.cameras[i];
  }
  return out;
}

}  // namespace tilegrad::train

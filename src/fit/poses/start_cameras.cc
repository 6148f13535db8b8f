// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/start_cameras.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/hash.h"
#include "base/json_text.h"
#include "fit/input.h"
#include "fit/masks/floor.h"
#include "fit/masks/start_masks.h"
#include "fit/poses/find_poses.h"
#include "fit/quarter_turn.h"
#include "fit/score.h"
#include "fit/sphere.h"
#include "scene/camera.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::json;

constexpr double kDoubt = 20;  // degrees between the two best starts
constexpr std::size_t kNumbers = 12;
constexpr double kMostNumber = 1e30;

TargetImages Chosen(const TargetImages& images, std::span<const int> views) {
  TargetImages out;
  out.width = images.width;
  out.height = images.height;
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
Json JsonOf(std::span<const Camera> cameras) {
  Json poses = Json::array();
  for (const Camera& c : cameras) {
    std::vector<double> numbers(c.rotation, c.rotation + 9);
    numbers.insert(numbers.end(), c.translation, c.translation + 3);
    poses.push_back(numbers);
  }
  return poses;
}

// Poses with these lenses; empty if `poses` is anything else than as many lists of numbers.
std::vector<Camera> CamerasOf(const Json& poses, std::span<const Camera> lenses) {
  std::vector<Camera> out(lenses.begin(), lenses.end());
  if (!poses.is_array() || poses.size() != lenses.size()) return {};
  for (std::size_t i = 0; i < lenses.size(); ++i) {
    const Json& pose = poses[i];
    if (!pose.is_array() || pose.size() != kNumbers) return {};
    for (std::size_t k = 0; k < kNumbers; ++k) {
      if (!pose[k].is_number() || !(std::abs(pose[k].get<double>()) < kMostNumber)) return {};
      (k < 9 ? out[i].rotation[k] : out[i].translation[k - 9]) = pose[k].get<float>();
    }
  }
  return out;
}

Result<Json> ReadKept(const Path& path) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  TILEGRAD_ASSIGN(const Json file, ParseJson(text, path.string()));
  return file.is_object() ? file : Json::object();
}

Status TakePoses(const Path& path, const Json& file, std::span<const Camera> lenses,
                 FoundPoses* out) {
  out->cameras = CamerasOf(file.value("poses", Json()), lenses);
  if (out->cameras.empty() || !file.value("agreement", Json()).is_number()) {
    return DataLoss("{}: does not hold {} poses of twelve numbers; delete it to search again",
                    path.string(), lenses.size());
  }
  out->agreement = file["agreement"].get<double>();
  return {};
}

Status Keep(const InputPosesJob& job, const FoundPoses& found) {
  const Json file = {
      {"agreement", found.agreement}, {"loss", found.loss}, {"poses", JsonOf(found.cameras)}};
  return job.file.empty() ? Status() : WriteTextAtomic(job.file, DumpJson(file, 1) + "\n");
}

// ---- Searches that were stopped before they agreed.

std::string ChecksumOf(const TargetImages& images) {
  Hash hash;
  hash.AddAll(images.color);
  hash.AddAll(images.alpha);
  return hash.Text();
}

Status KeepSearches(const Path& path, const std::string& images,
                    std::span<const PoseStart> searches) {
  Json file = {{"images", images}, {"searches", Json::array()}};
  for (const PoseStart& s : searches)
    file["searches"].push_back({{"loss", s.loss}, {"poses", JsonOf(s.cameras)}});
  return WriteTextAtomic(path, DumpJson(file, 1) + "\n");
}

// None where they are of other images.
std::vector<PoseStart> SearchesOf(const Json& file, const std::string& images,
                                  std::span<const Camera> lenses) {
  std::vector<PoseStart> out;
  if (file.value("images", Json()) != images || !file["searches"].is_array()) return out;
  for (const Json& search : file["searches"]) {
    if (!search.is_object() || !search.value("loss", Json()).is_number()) return {};
    out.push_back({CamerasOf(search.value("poses", Json()), lenses), search["loss"].get<double>()});
    if (out.back().cameras.empty()) return {};
  }
  return out;
}

// Found anew, or as far as `kept` has not found them.
Result<FoundPoses> Search(const InputPosesJob& job, const TargetImages& images,
                          std::span<const Camera> lenses, const Json& kept, const Workers& workers,
                          const Watch& watch) {
  PoseOptions options = job.options;
  if (!job.file.empty()) {
    const std::string checksum = ChecksumOf(images);
    if (kept.contains("searches")) options.done = SearchesOf(kept, checksum, lenses);
    options.keep = [&job, checksum](std::span<const PoseStart> searches) {
      return KeepSearches(job.file, checksum, searches);
    };
  }
  TILEGRAD_ASSIGN(FoundPoses found, FindPoses(images, lenses, options, workers, watch));
  TILEGRAD_TRY(Keep(job, found));
  return found;
}

// Held-out cameras were given in another world.
void MoveHeldOut(const std::vector<Camera>& given, FitInput* input) {
  const Similarity alignment =
      AlignCameras(Chosen(given, input->training), Chosen(input->cameras, input->training));
  for (const int i : input->held_out) {
    Camera& camera = input->cameras[static_cast<std::size_t>(i)];
    camera = Moved(camera, alignment);
  }
}

constexpr int kStep = 5, kFullTurn = 360, kHighest = 60;  // degrees
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kBeside = 7.5;  // degrees: what is less far to a side is not worth saying

// Degrees around the object, counterclockwise seen from above, and above its level.
struct Direction {
  double around, above;
};

// The object's level plane.
class Level {
 public:
  explicit Level(const glm::dvec3& up) : up_(up) {
    const glm::dvec3 any = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
    east_ = glm::normalize(any - glm::dot(any, up) * up);
    north_ = glm::cross(up, east_);
  }
  Direction Of(const glm::dvec3& v) const {
    const double height = glm::dot(v, up_) / glm::length(v);
    return {std::atan2(glm::dot(v, north_), glm::dot(v, east_)) / kDegree,
            std::asin(std::clamp(height, -1.0, 1.0)) / kDegree};
  }

 private:
  glm::dvec3 up_, east_, north_;
};

double Between(const Direction& a, const Direction& b) {
  const double cosine = std::sin(a.above * kDegree) * std::sin(b.above * kDegree) +
                        std::cos(a.above * kDegree) * std::cos(b.above * kDegree) *
                            std::cos((a.around - b.around) * kDegree);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) / kDegree;
}

glm::dvec3 StandOf(const Camera& c) {  // -R^T t
  glm::dvec3 eye(0);
  for (int i = 0; i < 9; ++i)
    eye[i % 3] -= static_cast<double>(c.rotation[i]) * static_cast<double>(c.translation[i / 3]);
  return eye;
}

std::vector<Direction> DirectionsOf(std::span<const Camera> cameras, const glm::dvec3& middle) {
  const Level level{glm::normalize(glm::dvec3(UpOf(cameras)))};
  std::vector<Direction> out;
  for (const Camera& c : cameras) out.push_back(level.Of(StandOf(c) - middle));
  return out;
}

ViewGap GapAt(const Direction& place, std::span<const Direction> views) {
  ViewGap gap;
  gap.degrees = HUGE_VAL;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const double degrees = Between(place, views[v]);
    if (degrees >= gap.degrees) continue;
    gap = {v, degrees, std::remainder(place.around - views[v].around, kFullTurn),
           place.above - views[v].above};
  }
  return gap;
}

// Of the steps; the best of a few on a van and a cat whose cameras were 2 degrees off.
constexpr double kCamerasRest = 0.4;
// Degrees between a direction and the nearest camera. Two rings of twelve cameras leave 25.
constexpr double kWideGap = 30;

// Nothing to note where masks do not locate the object.
void NoteWidestGap(FitInput* input) {
  const auto sphere = GuessSphere(*input);
  if (!sphere.ok()) return;
  const ViewGap gap = WidestGap(HeldCameras(*input, input->cameras), sphere->centre);
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
  if (job->input.masked) DoubtBorders(&job->input);
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

ViewGap WidestGap(std::span<const Camera> cameras, glm::vec3 middle) {
  const std::vector<Direction> views = DirectionsOf(cameras, glm::dvec3(middle));
  ViewGap widest;
  for (int above = 0; above <= kHighest; above += kStep) {
    for (int around = 0; around < kFullTurn; around += kStep) {
      const Direction place = {static_cast<double>(around), static_cast<double>(above)};
      const ViewGap gap = GapAt(place, views);
      if (gap.degrees > widest.degrees) widest = gap;
    }
  }
  return widest;
}

std::string DescribePlace(const ViewGap& gap, const std::string& name) {
  const auto sideways = fmt::format("{:.0f} degrees to the {} of {}", std::abs(gap.right),
                                    gap.right > 0 ? "right" : "left", name);
  const auto upwards =
      fmt::format("{:.0f} degrees {}", std::abs(gap.up), gap.up > 0 ? "higher" : "lower");
  if (std::abs(gap.up) < kBeside) return "about " + sideways;
  if (std::abs(gap.right) < kBeside) return fmt::format("about {} than {}", upwards, name);
  return fmt::format("about {} and {}", sideways, upwards);
}

Status FindInputPoses(const InputPosesJob& job, FitInput* input, const Workers& workers,
                      const ProgressSink& progress, const StopFlag& stop) {
  if (!input->masked) {
    return InvalidArgument(
        "cameras cannot be found without masks: give images with alpha, masks, or a plain "
        "background");
  }
  if (!input->turned.empty()) {
    return InvalidArgument(
        "{}: is not of the first image's orientation, portrait or landscape, which the search for "
        "cameras needs: leave it out, give cameras, or install COLMAP",
        input->names[static_cast<std::size_t>(input->turned[0])]);
  }
  std::vector<int> views = input->training;
  if (!input->posed) {
    views.resize(input->names.size());
    std::iota(views.begin(), views.end(), 0);
  }
  const std::vector<Camera> lenses = Chosen(input->cameras, views);
  FoundPoses found;
  Json kept = Json::object();
  if (job.reuse && PathExists(job.file)) {
    TILEGRAD_ASSIGN(kept, ReadKept(job.file));
  }
  if (kept.contains("poses")) {
    TILEGRAD_TRY(TakePoses(job.file, kept, lenses, &found));
  } else {
    TILEGRAD_ASSIGN(
        found, Search(job, Chosen(input->images, views), lenses, kept, workers, {progress, &stop}));
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
    input->warnings.push_back(
        fmt::format("the cameras are doubtful: the two best searches differ by {:.0f} degrees; "
                    "objects that look alike from several sides need cameras from another program",
                    found.agreement));
  }
  return {};
}

Result<std::vector<Camera>> RefineInputPoses(const InputPosesJob& job, const FitInput& input,
                                             std::span<const Camera> cameras,
                                             const Workers& workers, const Watch& watch) {
  const std::vector<Camera> from = Chosen(cameras, input.training);
  FoundPoses refined;
  refined.agreement = 0;
  if (job.reuse && PathExists(job.file)) {
    TILEGRAD_ASSIGN(const Json kept, ReadKept(job.file));
    TILEGRAD_TRY(TakePoses(job.file, kept, from, &refined));
  } else {
    TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(input));
    Similarity shrink;
    shrink.scale = 0.5 / static_cast<double>(sphere.radius);
    for (int i = 0; i < 3; ++i) {
      shrink.offset[i] = -shrink.scale * static_cast<double>(sphere.centre[i]);
    }
    std::vector<Camera> near = from;
    for (Camera& camera : near) camera = Moved(camera, shrink);
    TILEGRAD_ASSIGN(refined.cameras,
                    RefinePoses(Chosen(input.images, input.training), near, workers, watch));
    const Similarity back = AlignCameras(refined.cameras, from);
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

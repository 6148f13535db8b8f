// SPDX-License-Identifier: Apache-2.0
#include "fit/make_views.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "fit/frames.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "train/data/build/make_model.h"

namespace tilegrad::train {
namespace {

constexpr float kHalfExtent = 0.45f;
constexpr const char* kTrainName = "transforms_train.json";
constexpr const char* kTestName = "transforms_test.json";
constexpr const char* kTruthName = "truth.glb";

Status CheckViews(const ViewsOptions& o) {
  if (o.views < 1 || o.held_out < 0 || o.views + o.held_out > 100000) {
    return InvalidArgument(
        "{} views and {} held out: must be 1 or more, and at most 100000 in total", o.views,
        o.held_out);
  }
  if (o.size < 8 || o.size > 4096) return InvalidArgument("size is {}, must be 8 to 4096", o.size);
  if (!(o.distance > 0 && o.distance < 1e6)) {
    return InvalidArgument("distance is {}, must be positive", o.distance);
  }
  if (!(o.fov_y > 0 && o.fov_y < 180)) {
    return InvalidArgument("fov is {}, must be in (0, 180) degrees", o.fov_y);
  }
  if (!(o.lowest > -90 && o.lowest <= o.highest && o.highest < 90)) {
    return InvalidArgument("elevations {} to {} must ascend and be in (-90, 90) degrees", o.lowest,
                           o.highest);
  }
  return {};
}

// Equal steps of height, golden angles around.
Camera SpiralCamera(const ViewsOptions& o, int index) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const double low = std::sin(o.lowest / kDegrees), high = std::sin(o.highest / kDegrees);
  const double height = low + (high - low) * (index + 0.5) / (o.views + o.held_out);
  const double golden = 180 * (3 - std::sqrt(5.0));
  return OrbitCamera({o.fov_y, o.size, o.size}, std::fmod(golden * index, 360),
                     std::asin(height) * kDegrees, o.distance);
}

// Whether image `index` of all is held out: evenly spread.
bool IsHeldOut(const ViewsOptions& o, int index) {
  const int all = o.views + o.held_out;
  return (index + 1) * o.held_out / all != index * o.held_out / all;
}

std::string ImageName(int index) { return fmt::format("images/{:03}.png", index); }

// What an earlier call left that this one may not write: cameras, and the images that they name as
// it names them.
std::vector<Path> EarlierViews(const Path& folder) {
  std::vector<Path> cameras = {folder / kTrainName, folder / kTestName}, images;
  if (!PathExists(folder / kTruthName)) return cameras;
  for (const Path& file : cameras) {
    const auto frames = ReadTransforms(file);
    if (!frames.ok()) continue;
    for (const InputFrame& frame : *frames) {
      const int index = std::atoi(frame.image.stem().c_str());
      if (frame.image == folder / ImageName(index)) images.push_back(frame.image);
    }
  }
  cameras.insert(cameras.end(), images.begin(), images.end());
  return cameras;
}

// Views of another mesh that stay would be fitted or judged by: they go, cameras first.
Status ClearEarlierViews(const Path& folder, const OutputGuard& guard) {
  const Path other = folder / "transforms.json";  // what a fit reads first
  if (PathExists(other)) {
    return InvalidArgument(
        "{}: describes other images, and a fit would read it; choose another folder",
        other.string());
  }
  TILEGRAD_TRY(guard.CheckFolder(folder));
  const std::vector<Path> files = EarlierViews(folder);
  TILEGRAD_TRY(guard.CheckAll(files));
  return RemoveFiles(files);
}

}  // namespace

Status MakeViews(Mesh mesh, const ViewsOptions& options, const Path& folder,
                 const OutputGuard& guard, const ProgressSink& progress, const StopFlag& stop) {
  TILEGRAD_TRY(CheckViews(options));
  RemoveGlass(&mesh);
  TILEGRAD_TRY(NormalizeToBox(mesh, kHalfExtent));
  TILEGRAD_TRY(ClearEarlierViews(folder, guard));
  const Path truth = folder / kTruthName;
  TILEGRAD_TRY(WriteGuarded(guard, truth, [&] { return io::SaveGlb(truth, mesh); }));
  LitRenderer renderer;
  std::vector<OutputFrame> train, test;
  const int all = options.views + options.held_out;
  for (int i = 0; i < all; ++i) {
    if (stop) return Cancelled("stopped; {} is not complete", folder.string());
    const Camera camera = SpiralCamera(options, i);
    TILEGRAD_ASSIGN(const ImageU8 image, renderer.RenderStraight(mesh, camera, options.size));
    const std::string name = ImageName(i);
    TILEGRAD_TRY(
        WriteGuarded(guard, folder / name, [&] { return io::SavePng(folder / name, image); }));
    (IsHeldOut(options, i) ? test : train).push_back({name, camera});
    if (progress) {
      progress(
          {"rendering", static_cast<std::uint64_t>(i + 1), static_cast<std::uint64_t>(all), ""});
    }
  }
  const ImageSize size{options.size, options.size};
  const auto write = [&](const char* name, const std::vector<OutputFrame>& views) {
    return WriteGuarded(guard, folder / name, [&] {
      return WriteTextAtomic(folder / name, WriteTransforms(views, size));
    });
  };
  if (!test.empty()) TILEGRAD_TRY(write(kTestName, test));
  TILEGRAD_TRY(write(kTrainName, train));
  return {};
}

}  // namespace tilegrad::train

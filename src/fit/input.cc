// SPDX-License-Identifier: Apache-2.0
#include "fit/input.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "fit/colmap_run.h"
#include "fit/frames.h"
#include "fit/masks/floor.h"
#include "fit/masks/start_masks.h"
#include "fit/quarter_turn.h"
#include "fit/undistort.h"
#include "io/camera_file.h"
#include "train/data/dataset.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

// How cameras stand about an axis of the world: means of the axis along their x and y axes.
struct Stand {
  double tilt = 0, upright = 0;
};

Stand StandAbout(std::span<const Camera> cameras, int axis) {
  Stand out;
  for (const Camera& camera : cameras) {
    out.tilt += std::abs(static_cast<double>(camera.rotation[axis]));
    out.upright += static_cast<double>(camera.rotation[3 + axis]);
  }
  out.tilt /= static_cast<double>(cameras.size());
  out.upright /= static_cast<double>(cameras.size());
  return out;
}

// Turns the world so that `up`, of length 1, becomes y.
void TurnLevel(glm::vec3 up, std::span<Camera> cameras) {
  const glm::vec3 any = std::abs(up.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
  const glm::vec3 z = glm::normalize(glm::cross(any, up)), x = glm::cross(up, z);
  for (Camera& camera : cameras) {
    for (int row = 0; row < 9; row += 3) {
      float* const r = camera.rotation + row;
      const glm::vec3 old(r[0], r[1], r[2]);
      r[0] = glm::dot(x, old);
      r[1] = glm::dot(up, old);
      r[2] = glm::dot(z, old);
    }
  }
}

constexpr std::size_t kMostPixels = std::size_t{1} << 30;  // of all views together

// Masks are those that images came with, if there are any.
bool TakesMasks(Background background) {
  return background == Background::kAuto || background == Background::kMask;
}

// An image and its camera, reduced.
struct ReducedView {
  Camera camera;
  TargetImages image;
};

ReducedView ReduceView(int factor, const Camera& camera, const ViewPixels& view) {
  const auto [width, height] = view.size;
  TargetImages image{width,
                     height,
                     {view.color.begin(), view.color.end()},
                     {view.alpha.begin(), view.alpha.end()}};
  if (factor == 1) return {camera, std::move(image)};
  image = Reduce(image, factor);
  const ImageSize used{factor * image.width, factor * image.height};
  const Camera64 small =
      ResizeCamera(CameraCast<double>(camera), used, {image.width, image.height});
  return {CameraCast<float>(small), std::move(image)};
}

// Grows an input by one view after the other.
class InputReader {
 public:
  InputReader(int most_side, FitInput* input) : most_side_(most_side), input_(*input) {}

  Status AddAll(std::span<const InputFrame> frames, const Watch& watch) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      TILEGRAD_TRY(watch.At({"reading images", i, frames.size(), ""}));
      TILEGRAD_TRY(Add(frames[i]));
    }
    if (factor_ > 1) {
      input_.notes.push_back(fmt::format(
          "images: {} times smaller a side, {} x {} pixels (--image-side 0 takes them as they are)",
          factor_, input_.images.width, input_.images.height));
    }
    return watch.At({"reading images", frames.size(), frames.size(), ""});
  }

  // Either all views have a mask or none.
  Status CheckMasks(Background background) const {
    if (!TakesMasks(background) || bare_.empty() || !HasAlpha(input_)) return {};
    return DataLoss(
        "{}: has no mask, but {} has one ({}); add one, or use --background plain or none for all",
        bare_[0].image, masked_[0].image, masked_[0].mask);
  }

 private:
  struct Source {
    std::string image, mask;
  };

  Status Add(const InputFrame& frame) {
    TILEGRAD_TRY(CheckFiles(frame));
    TILEGRAD_ASSIGN(ViewPixels view, LoadViewPixels(frame));
    TILEGRAD_TRY(CheckSize(frame, view));
    const auto camera = CameraOfFrame(frame, view.size);
    if (!camera.ok()) return camera.status().Within("camera of " + frame.image.string());
    Camera straight = Undistort(frame.camera.lens, *camera, &view);
    if (IsOtherOrientation(view.size)) Turn(&straight, &view);
    const ReducedView reduced = ReduceView(factor_, straight, view);
    const TargetImages& image = reduced.image;
    input_.cameras.push_back(reduced.camera);
    input_.names.push_back(frame.image.filename().string());
    input_.images.color.insert(input_.images.color.end(), image.color.begin(), image.color.end());
    input_.images.alpha.insert(input_.images.alpha.end(), image.alpha.begin(), image.alpha.end());
    (view.mask.empty() ? bare_ : masked_).push_back({frame.image.string(), view.mask});
    return {};
  }

  // Where cameras and images come apart: those that are deleted or moved.
  static Status CheckFiles(const InputFrame& frame) {
    for (const Path& file : {frame.image, frame.mask}) {
      if (file.empty() || PathExists(file)) continue;
      return NotFound("{}: {}: no such file; restore it, or take this view out", frame.camera.place,
                      file.string());
    }
    return {};
  }

  Status CheckSize(const InputFrame& frame, const ViewPixels& view) {
    TargetImages& all = input_.images;
    if (input_.names.empty()) SetSize(frame.image, view.size);
    const bool same = view.size.width == size_.width && view.size.height == size_.height;
    if (!same && !IsOtherOrientation(view.size)) {
      return DataLoss(
          "{}: has {} x {} pixels, {} has {} x {}; a fit takes images of one size, portrait "
          "or landscape: crop or resize one of them, or leave it out",
          frame.image.string(), view.size.width, view.size.height, first_.string(), size_.width,
          size_.height);
    }
    if ((input_.names.size() + 1) * all.pixels() <= kMostPixels) return {};
    return ResourceExhausted("{}: all images together have more than {} pixels",
                             frame.image.string(), kMostPixels);
  }

  bool IsOtherOrientation(ImageSize size) const {
    return size.width != size.height && size.width == size_.height && size.height == size_.width;
  }

  // The view that is added next.
  void Turn(Camera* camera, ViewPixels* view) {
    *camera = TurnedCamera(*camera, view->size.height);
    view->color = TurnedPlanes(view->color, view->size);
    view->alpha = TurnedPlanes(view->alpha, view->size);
    view->size = size_;
    input_.turned.push_back(static_cast<int>(input_.names.size()));
  }

  // Of all images.
  void SetSize(const Path& first, ImageSize size) {
    const auto [shorter, longer] = std::minmax(size.width, size.height);
    first_ = first;
    size_ = size;
    factor_ = most_side_ > 0 ? std::min(shorter, (longer - 1) / most_side_ + 1) : 1;
    input_.images.width = size.width / factor_;
    input_.images.height = size.height / factor_;
  }

  const int most_side_;
  FitInput& input_;
  Path first_;      // has `size_`
  ImageSize size_;  // of the images, of which the fit takes 1 / factor_ a side
  int factor_ = 1;
  std::vector<Source> masked_, bare_;
};

// Every n-th view, from the n-th on, is held out, as are those that are already.
void HoldOut(int every, FitInput* input) {
  std::vector<int> more;
  for (int i = 0; i < static_cast<int>(input->cameras.size()); ++i) {
    if (std::ranges::find(input->held_out, i) != input->held_out.end()) continue;
    const bool held = every > 0 && i % every == every - 1;
    (held ? more : input->training).push_back(i);
  }
  input->held_out.insert(input->held_out.end(), more.begin(), more.end());
}

struct Frames {
  std::vector<InputFrame> frames;
  bool posed = true, own_world = false;
  std::vector<std::string> warnings;
};

// Why there is nothing to fit in a folder.
Status NothingIn(const Path& folder, const Frames& bare) {
  if (PathExists(DatasetInfoPath(folder))) {
    return InvalidArgument(
        "{}: was made by tilegrad dataset; choose one of its models with --model CLASS/ID",
        folder.string());
  }
  if (IsFile(folder)) {
    return InvalidArgument(
        "{}: is a file; give the folder that holds transforms.json, a COLMAP model or images",
        folder.string());
  }
  if (!PathExists(folder)) return NotFound("{}: no such folder", folder.string());
  if (!bare.frames.empty()) return {};
  return NotFound(
      "{}: holds no transforms.json, no COLMAP model and no pictures (docs/fit.md lists what a fit "
      "reads){}",
      folder.string(), bare.warnings.empty() ? "" : "; " + bare.warnings[0]);
}

// Of transforms.json, or of a COLMAP model where there is none, or pictures without cameras.
Result<Frames> ReadFrames(const Path& folder, double fov) {
  Frames out;
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    if (!PathExists(folder / name)) continue;
    TILEGRAD_ASSIGN(out.frames, ReadTransforms(folder / name));
    return out;
  }
  if (const auto model = io::FindColmapModel(folder)) {
    if (!model->note.empty()) out.warnings.push_back(model->note);
    out.own_world = PathExists(folder / kColmapPictures);
    TILEGRAD_ASSIGN(out.frames, ReadColmapFrames(model->folder));
    return out;
  }
  out.posed = false;
  out.frames = ReadBareFrames(folder, fov, &out.warnings);
  TILEGRAD_TRY(NothingIn(folder, out));
  return out;
}

Status CheckCameras(const FitInput& input) {
  const ImageSize size{input.images.width, input.images.height};
  for (std::size_t i = 0; i < input.cameras.size(); ++i) {
    TILEGRAD_TRY(CheckCamera(CameraCast<double>(input.cameras[i]), size)
                     .Within("camera of " + input.names[i]));
  }
  return {};
}

// Where others have a border, a mask without one says most likely nothing.
void WarnOfFullMasks(FitInput* input) {
  const std::size_t plane = input->images.pixels();
  for (std::size_t n = 0; n < input->names.size(); ++n) {
    const auto alpha = std::span(input->images.alpha).subspan(n * plane, plane);
    if (std::ranges::all_of(alpha, [](float a) { return a >= 1; })) {
      input->warnings.push_back(input->names[n] +
                                ": its mask is full: every pixel counts as the object");
    }
  }
}

Result<int> FindModel(const Dataset& dataset, const std::string& name) {
  for (std::size_t i = 0; i < dataset.models().size(); ++i) {
    const ModelInfo& model = dataset.models()[i];
    if (dataset.ClassOf(model) + "/" + model.id == name) return static_cast<int>(i);
  }
  return NotFound("{}: no model \"{}\" in it; models.jsonl lists them, as CLASS/ID",
                  dataset.folder().string(), name);
}

// Adds the frames of `test`, which are then not fitted, even if they were listed before.
Status AddHeldOut(const Path& test, std::vector<InputFrame>* frames, FitInput* input) {
  TILEGRAD_ASSIGN(auto more, ReadTransforms(test));
  const auto repeated = std::erase_if(*frames, [&](const InputFrame& frame) {
    return std::ranges::find(more, frame.image, &InputFrame::image) != more.end();
  });
  if (repeated > 0) {
    input->warnings.push_back(fmt::format("{}: {} among the images to fit, too; held out",
                                          test.string(), Count(repeated, "image")));
  }
  for (InputFrame& frame : more) {
    input->held_out.push_back(static_cast<int>(frames->size()));
    frames->push_back(std::move(frame));
  }
  return {};
}

}  // namespace

TargetImages TargetsOfPlanar(std::span<const std::uint8_t> bytes, int size) {
  TargetImages out;
  out.width = out.height = size;
  const std::size_t plane = out.pixels(), views = bytes.size() / (4 * plane);
  out.color.resize(3 * plane * views);
  out.alpha.resize(plane * views);
  for (std::size_t n = 0; n < views; ++n) {
    const std::uint8_t* from = &bytes[4 * plane * n];
    for (std::size_t p = 0; p < plane; ++p) {
      const float alpha = static_cast<float>(from[3 * plane + p]) / 255;
      out.alpha[n * plane + p] = alpha;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = static_cast<float>(from[c * plane + p]) / 255;
        out.color[(3 * n + c) * plane + p] = alpha > 0 ? std::min(value / alpha, 1.0f) : 0.0f;
      }
    }
  }
  return out;
}

Status FinishInput(const InputOptions& options, FitInput* input) {
  TILEGRAD_TRY(CheckCameras(*input));
  HoldOut(options.hold_out, input);
  if (TakesMasks(options.background) && HasAlpha(*input)) WarnOfFullMasks(input);
  TILEGRAD_TRY(SeekMasks(options.background, input));
  TILEGRAD_TRY(ApplyBackground(options.background, input, options.watch));
  TILEGRAD_TRY(DropEmptyViews(input));
  if (input->training.empty())
    return InvalidArgument("all views are held out; none is left to fit");
  if (input->posed) TurnInputUpright(options.up, input);
  return {};
}

Result<FitInput> ReadFitFolder(const Path& folder, const InputOptions& options) {
  FitInput input;
  TILEGRAD_ASSIGN(Frames read, ReadFrames(folder, options.fov));
  input.posed = read.posed;
  input.own_world = read.own_world;
  input.warnings = std::move(read.warnings);
  const Path test = folder / "transforms_test.json";
  if (PathExists(test) && options.hold_out > 0) {
    return InvalidArgument(
        "{}: already lists the held-out views; leave out --hold-out, or remove that file",
        test.string());
  }
  if (PathExists(test) && input.posed) TILEGRAD_TRY(AddHeldOut(test, &read.frames, &input));
  InputReader reader(options.image_side, &input);
  TILEGRAD_TRY(reader.AddAll(read.frames, options.watch));
  if (options.masks.empty()) {
    TILEGRAD_TRY(reader.CheckMasks(options.background));
  } else {
    TILEGRAD_TRY(ReadMasks(options.masks, &input));
  }
  TILEGRAD_TRY(FinishInput(options, &input));
  return input;
}

Result<FitInput> ReadFitDataset(const Path& folder, const std::string& model, int hold_out) {
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  TILEGRAD_ASSIGN(const int index, FindModel(dataset, model));
  TILEGRAD_ASSIGN(ModelData data, dataset.Load(index));
  FitInput input;
  input.images = TargetsOfPlanar(data.images, dataset.info().image_size);
  input.cameras = CamerasOf(dataset.info(), data.cameras);
  for (std::size_t i = 0; i < input.cameras.size(); ++i)
    input.names.push_back(fmt::format("view {}", i));
  input.occupancy = std::move(data.occupancy);
  TILEGRAD_TRY(FinishInput({hold_out, Background::kMask, kUsualFov, UpAxis::kY}, &input));
  return input;
}

TargetImages Reduce(const TargetImages& images, int factor) {
  if (factor == 1) return images;
  TargetImages out;
  out.width = images.width / factor;
  out.height = images.height / factor;
  const std::size_t views = images.alpha.size() / images.pixels(), plane = out.pixels();
  out.color.resize(3 * plane * views);
  out.alpha.resize(plane * views);
  if (!images.silhouette.empty()) out.silhouette.resize(plane * views);
  const auto wide = static_cast<std::size_t>(images.width), f = static_cast<std::size_t>(factor);
  const auto width = static_cast<std::size_t>(out.width);
  for (std::size_t i = 0; i < plane * views; ++i) {
    const std::size_t n = i / plane, x = i % plane % width, y = i % plane / width;
    float alpha = 0, silhouette = 0, color[3] = {};
    for (std::size_t s = 0; s < f * f; ++s) {
      const std::size_t p = (y * f + s / f) * wide + x * f + s % f;
      const float a = images.alpha[n * images.pixels() + p];
      alpha += a;
      if (!images.silhouette.empty()) silhouette += images.silhouette[n * images.pixels() + p];
      for (std::size_t c = 0; c < 3; ++c) {
        color[c] += a * images.color[(3 * n + c) * images.pixels() + p];
      }
    }
    out.alpha[i] = alpha / static_cast<float>(f * f);
    if (!images.silhouette.empty()) out.silhouette[i] = silhouette / static_cast<float>(f * f);
    for (std::size_t c = 0; c < 3; ++c) {
      out.color[(3 * n + c) * plane + i % plane] = alpha > 0 ? color[c] / alpha : 0.0f;
    }
  }
  return out;
}

std::optional<UpAxis> GuessUp(std::span<const Camera> cameras) {
  constexpr double kLevel = 0.1, kRolled = 0.25, kUpright = 0.2;
  constexpr std::size_t kLeastCameras = 4;
  if (cameras.size() < kLeastCameras || StandAbout(cameras, 1).tilt < kRolled) return std::nullopt;
  for (const auto& [axis, up] : {std::pair(2, UpAxis::kZ), std::pair(0, UpAxis::kX)}) {
    const Stand stand = StandAbout(cameras, axis);
    if (stand.tilt < kLevel && stand.upright > kUpright) return up;
  }
  return std::nullopt;
}

void TurnInputUpright(std::optional<UpAxis> up, FitInput* input) {
  const std::vector<Camera> held = HeldCameras(*input, input->cameras);
  if (!up && input->own_world) return TurnLevel(UpOf(held), input->cameras);
  if (!up) {
    up = GuessUp(held);
    if (up) {
      input->warnings.push_back(
          fmt::format("all cameras are upright if {0} points up, so the mesh is turned from {0} up "
                      "to y up; --up y leaves it as it is",
                      *up == UpAxis::kZ ? "z" : "x"));
    }
  }
  input->up = up.value_or(UpAxis::kY);
  for (Camera& camera : input->cameras) camera = UprightCamera(input->up, camera);
}

}  // namespace tilegrad::train

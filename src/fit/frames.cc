// SPDX-License-Identifier: Apache-2.0
#include "fit/frames.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "io/camera_file.h"
#include "io/image_file.h"
#include "scene/camera.h"
#include "scene/camera_conventions.h"
#include "tilegrad/status.h"

namespace tilegrad::train {
namespace {

// Its pictures; a warning names those that are not read.
std::vector<Path> TakePictures(const Path& folder, std::vector<std::string>* warnings) {
  io::PictureNames found = io::PicturesIn(folder);
  if (!found.others.empty())
    warnings->push_back(fmt::format("{}: left out {}", folder.string(), found.DescribeOthers()));
  return std::move(found.read);
}

// The folder that the names of images count from: some may have been deleted.
Result<Path> FindImages(const Path& model, const std::vector<io::CameraView>& views) {
  std::error_code error;
  Path folder = std::filesystem::absolute(model, error).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();  // "model/"
  for (int up = 0; up < 4; ++up, folder = folder.parent_path()) {
    for (const Path& candidate : {folder / "images", folder}) {
      const auto holds = [&](const io::CameraView& view) {
        return IsFile(candidate / io::PortablePath(view.name));
      };
      if (std::ranges::any_of(views, holds)) return candidate;
    }
  }
  return NotFound(
      "{}: image {} not found, neither beside the model or above it nor in a folder \"images\" "
      "there",
      model.string(), views[0].name);
}

// The mask of `images`/`name`, in a folder "masks" or "mask" beside `images` or in it; empty where
// there is none.
Path MaskFileOf(const Path& images, const Path& name) {
  for (const Path& folder :
       {images.parent_path() / "masks", images.parent_path() / "mask", images / "masks"}) {
    for (const Path& candidate : {folder / (name.string() + ".png"),
                                  (folder / name).replace_extension(".png"), folder / name}) {
      if (IsFile(candidate)) return candidate;
    }
  }
  return {};
}

// That of an image in a folder "images", as other projects have them.
Path MaskBeside(const Path& image) {
  const Path images = image.parent_path();
  return images.filename() == "images" ? MaskFileOf(images, image.filename()) : Path();
}

io::NerfFrame FrameOf(const io::CameraView& view) {
  const NerfCamera camera = ToNerf(view.camera);
  io::NerfFrame frame;
  frame.place = view.name;
  frame.camera_to_world = camera.camera_to_world;
  frame.fl_x = camera.fl_x;
  frame.fl_y = camera.fl_y;
  frame.cx = camera.cx;
  frame.cy = camera.cy;
  frame.size = view.size;
  frame.lens = view.lens;
  return frame;
}

// Lenses that see from 179.9 degrees to a hundred-thousandth of one.
constexpr double kLeastFocal = 5e-4, kMostFocal = 1e7;  // longer sides of the image
constexpr double kMostOffCentre = 1e4;                  // longer sides of the image
constexpr double kFarthest = 1e9;                       // world units

// As it is written, with slashes, or with the ending that it leaves out: what is there of these.
Path FindFile(const Path& folder, const std::string& name) {
  const Path path = folder / name;
  Path portable = folder / io::PortablePath(name);
  for (const Path& candidate : {path, portable, Path(portable.string() + ".png")}) {
    if (PathExists(candidate)) return candidate;
  }
  return portable;
}

// Up to a pixel of each side, to which smaller copies of images are rounded.
Status CheckAspect(ImageSize own, ImageSize image) {
  const double off = 1.0 * own.width * image.height - 1.0 * own.height * image.width;
  if (std::abs(off) <= own.width + own.height + image.width + image.height) return {};
  return InvalidArgument(
      "it is for {} x {} pixels (\"w\", \"h\"), but the image has {} x {}, of another shape",
      own.width, own.height, image.width, image.height);
}

}  // namespace

Result<std::vector<InputFrame>> ReadTransforms(const Path& path) {
  TILEGRAD_ASSIGN(auto frames, io::ReadNerfFrames(path));
  const auto names_mask = [](const io::NerfFrame& frame) { return frame.mask.has_value(); };
  const bool named = std::ranges::any_of(frames, names_mask);
  std::vector<InputFrame> out;
  for (io::NerfFrame& frame : frames) {
    if (!frame.image) return DataLoss("{}: needs \"file_path\", a string", frame.place);
    InputFrame& one = out.emplace_back();
    one.image = FindFile(path.parent_path(), *frame.image);
    if (frame.mask) one.mask = FindFile(path.parent_path(), *frame.mask);
    if (!named) one.mask = MaskBeside(one.image);
    one.camera = std::move(frame);
  }
  return out;
}

Result<Camera> CameraOfFrame(const InputFrame& frame, ImageSize image) {
  const ImageSize own = frame.camera.size.value_or(image);
  TILEGRAD_TRY(CheckAspect(own, image));
  io::NerfFrame from = frame.camera;
  if (frame.angle_long > 0)
    from.fl_x = 0.5 * std::max(own.width, own.height) / std::tan(0.5 * frame.angle_long);
  TILEGRAD_ASSIGN(const Camera64 camera, io::CameraOf(from, own));
  const Camera64 resized = ResizeCamera(camera, own, image);
  TILEGRAD_TRY(CheckCamera(resized, image));
  return CameraCast<float>(resized);
}

std::string WriteTransforms(const std::vector<OutputFrame>& views, ImageSize size) {
  nlohmann::ordered_json frames = nlohmann::ordered_json::array();
  for (const OutputFrame& view : views) {
    const NerfCamera pose = ToNerf(CameraCast<double>(view.camera));
    nlohmann::ordered_json matrix = nlohmann::ordered_json::array();
    for (std::size_t r = 0; r < 4; ++r) {
      const double* row = &pose.camera_to_world[4 * r];
      matrix.push_back({row[0], row[1], row[2], row[3]});
    }
    nlohmann::ordered_json frame = {{"file_path", view.image}, {"fl_x", pose.fl_x},
                                    {"fl_y", pose.fl_y},       {"cx", pose.cx},
                                    {"cy", pose.cy},           {"transform_matrix", matrix}};
    if (view.gain != 1) frame["exposure_gain"] = view.gain;
    if (view.size) frame.update({{"w", view.size->width}, {"h", view.size->height}});
    frames.push_back(std::move(frame));
  }
  nlohmann::ordered_json file = {{"w", size.width}, {"h", size.height}, {"frames", frames}};
  return JsonText(std::move(file), 1) + "\n";
}

Status CheckCamera(const Camera64& camera, ImageSize image) {
  TILEGRAD_TRY(Validate(camera));
  const double side = std::max(image.width, image.height);
  const double least = kLeastFocal * side, most = kMostFocal * side;
  for (const double focal : {camera.fx, camera.fy}) {
    if (focal >= least && focal <= most) continue;
    return InvalidArgument(
        "the camera's focal lengths are {:.6g} and {:.6g} pixels; a fit takes {:.3g} to {:.3g} for "
        "an image of {} x {}",
        camera.fx, camera.fy, least, most, image.width, image.height);
  }
  const double off = std::max(std::abs(camera.cx), std::abs(camera.cy));
  if (off > kMostOffCentre * side) {
    return InvalidArgument(
        "the camera's principal point is ({:.6g}, {:.6g}), far from an image of "
        "{} x {} pixels",
        camera.cx, camera.cy, image.width, image.height);
  }
  const double* t = camera.translation;
  const double distance = std::hypot(t[0], t[1], t[2]);
  if (distance <= kFarthest) return {};
  return InvalidArgument(
      "the camera is {:.6g} from the world's origin; a fit takes cameras up to {:g} away: scale or "
      "move them",
      distance, kFarthest);
}

Result<std::vector<InputFrame>> ReadColmapFrames(const Path& model) {
  TILEGRAD_ASSIGN(const auto views, io::LoadColmapCameras(model, {.bent = true}));
  TILEGRAD_ASSIGN(const Path images, FindImages(model, views));
  std::vector<InputFrame> frames;
  for (const io::CameraView& view : views) {
    const std::string name = io::PortablePath(view.name);
    InputFrame frame;
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.stored_order = true;  // COLMAP ignores the tag of orientation
    frame.camera = FrameOf(view);
    frames.push_back(std::move(frame));
  }
  return frames;
}

InputFrame BareFrame(double fov) {
  InputFrame frame;
  frame.camera.camera_to_world = NerfCamera().camera_to_world;
  frame.angle_long = fov * std::numbers::pi / 180;
  return frame;
}

std::vector<InputFrame> ReadBareFrames(const Path& folder, double fov,
                                       std::vector<std::string>* warnings) {
  Path images = folder / "images";
  std::vector<Path> pictures = TakePictures(images, warnings);
  if (pictures.empty()) {
    images = folder;
    pictures = TakePictures(images, warnings);
  }
  std::vector<InputFrame> frames;
  for (const Path& name : pictures) {
    InputFrame frame = BareFrame(fov);
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.camera.place = name.string();
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "fit/colmap_frames.h"

#include "base/error.h"
#include "base/file.h"
#include "io/camera_file.h"

namespace tilegrad::train {
namespace {

// The folder that the names of images count from.
Result<Path> FindImages(const Path& model, const std::string& first) {
  std::error_code error;
  Path folder = std::filesystem::absolute(model, error).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();  // "model/"
  for (int up = 0; up < 4; ++up, folder = folder.parent_path()) {
    for (const Path& candidate : {folder / "images", folder}) {
      if (IsFile(candidate / first)) return candidate;
    }
  }
  return NotFound(
      "{}: image {} not found, neither beside the model or above it nor in a folder \"images\" "
      "there",
      model.string(), first);
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

}  // namespace

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

Result<std::vector<TransformsFrame>> ReadColmapFrames(const Path& model) {
  TILEGRAD_ASSIGN(const auto views, io::LoadColmapCameras(model, {.bent = true}));
  TILEGRAD_ASSIGN(const Path images, FindImages(model, io::PortablePath(views[0].name)));
  std::vector<TransformsFrame> frames;
  for (const io::CameraView& view : views) {
    const std::string name = io::PortablePath(view.name);
    TransformsFrame frame;
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.stored_order = true;  // COLMAP ignores the tag of orientation
    frame.camera = FrameOf(view);
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "fit/bare_frames.h"

#include <numbers>

#include "base/error.h"
#include "fit/colmap_frames.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

// Its pictures; a warning names those that are not read.
std::vector<Path> TakePictures(const Path& folder, std::vector<std::string>* warnings) {
  io::PictureNames found = io::PicturesIn(folder);
  if (!found.others.empty())
    warnings->push_back(fmt::format("{}: left out {}", folder.string(), found.DescribeOthers()));
  return std::move(found.read);
}

}  // namespace

TransformsFrame BareFrame(double fov) {
  TransformsFrame frame;
  frame.camera.camera_to_world = NerfCamera().camera_to_world;
  frame.angle_long = fov * std::numbers::pi / 180;
  return frame;
}

std::vector<TransformsFrame> ReadBareFrames(const Path& folder, double fov,
                                            std::vector<std::string>* warnings) {
  Path images = folder / "images";
  std::vector<Path> pictures = TakePictures(images, warnings);
  if (pictures.empty()) {
    images = folder;
    pictures = TakePictures(images, warnings);
  }
  std::vector<TransformsFrame> frames;
  for (const Path& name : pictures) {
    TransformsFrame frame = BareFrame(fov);
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.camera.place = name.string();
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace tilegrad::train

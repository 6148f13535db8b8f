// SPDX-License-Identifier: Apache-2.0
#include "fit/bare_frames.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <numbers>
#include <string_view>

#include "base/text.h"
#include "fit/colmap_frames.h"

namespace tilegrad::train {
namespace {

bool IsPicture(const Path& file) {
  static constexpr std::array<std::string_view, 4> kEndings = {".png", ".jpg", ".jpeg", ".webp"};
  const std::string ending = LowerCase(file.extension().string());
  return std::ranges::find(kEndings, ending) != kEndings.end();
}

// Their names, sorted.
std::vector<Path> PicturesIn(const Path& folder) {
  std::vector<Path> out;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    if (at->is_regular_file(error) && IsPicture(at->path())) out.push_back(at->path().filename());
  }
  std::ranges::sort(out);
  return out;
}

}  // namespace

TransformsFrame BareFrame(double fov) {
  TransformsFrame frame;
  frame.camera.camera_to_world = NerfCamera().camera_to_world;
  frame.angle_long = fov * std::numbers::pi / 180;
  return frame;
}

Result<std::vector<TransformsFrame>> ReadBareFrames(const Path& folder, double fov) {
  Path images = folder / "images";
  std::vector<Path> names = PicturesIn(images);
  if (names.empty()) images = folder, names = PicturesIn(images);
  std::vector<TransformsFrame> frames;
  for (const Path& name : names) {
    TransformsFrame frame = BareFrame(fov);
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.camera.place = name.string();
    frames.push_back(std::move(frame));
  }
  TILEGRAD_TRY(CheckAllMasked(frames));
  return frames;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "fit/bare_frames.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <span>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "fit/colmap_frames.h"

namespace tilegrad::train {
namespace {

constexpr std::array<std::string_view, 4> kRead = {".png", ".jpg", ".jpeg", ".webp"};
constexpr std::array<std::string_view, 23> kOthers = {
    ".heic", ".heif", ".avif", ".tif", ".tiff", ".bmp", ".gif", ".tga",
    ".jp2",  ".jxl",  ".jfif", ".psd", ".exr",  ".hdr", ".ppm", ".pgm",
    ".dng",  ".cr2",  ".cr3",  ".nef", ".arw",  ".raf", ".orf"};

// Names of files with such an ending, sorted.
std::vector<Path> FilesIn(const Path& folder, std::span<const std::string_view> endings) {
  std::vector<Path> out;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    const std::string ending = LowerCase(at->path().extension().string());
    const bool wanted = std::ranges::find(endings, ending) != endings.end();
    if (wanted && at->is_regular_file(error)) out.push_back(at->path().filename());
  }
  std::ranges::sort(out);
  return out;
}

void WarnOfOthers(const Path& folder, std::vector<std::string>* warnings) {
  constexpr std::size_t kNamed = 5;
  const std::vector<Path> others = FilesIn(folder, kOthers);
  if (others.empty()) return;
  std::string names;
  for (std::size_t i = 0; i < std::min(others.size(), kNamed); ++i)
    names += (i == 0 ? "" : ", ") + others[i].string();
  warnings->push_back(fmt::format("{}: left out {} (not PNG, JPEG or WebP): {}{}", folder.string(),
                                  Count(others.size(), "picture"), names,
                                  others.size() > kNamed ? ", ..." : ""));
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
  if (FilesIn(images, kRead).empty()) images = folder;
  WarnOfOthers(images, warnings);
  std::vector<TransformsFrame> frames;
  for (const Path& name : FilesIn(images, kRead)) {
    TransformsFrame frame = BareFrame(fov);
    frame.image = images / name;
    frame.mask = MaskFileOf(images, name);
    frame.camera.place = name.string();
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace tilegrad::train

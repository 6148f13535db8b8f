// SPDX-License-Identifier: Apache-2.0
// COLMAP's text, written.
#include <filesystem>
#include <string_view>

#include "base/error.h"
#include "io/camera_file.h"

namespace tilegrad::io {
namespace {

constexpr int kMostPixels = 1 << 20;  // a side, as the reader has it

// What the reader refuses, or would read as another name, is not written.
Status CheckForColmap(const CameraView& view, const ColmapCamera& camera) {
  const auto [width, height] = view.size;
  if (width < 1 || height < 1 || width > kMostPixels || height > kMostPixels) {
    return InvalidArgument("\"{}\" has an image of {} x {} pixels", view.name, width, height);
  }
  if (view.name.empty()) return InvalidArgument("a view has no name, which COLMAP's text needs");
  const bool one_line = view.name.find_first_of(std::string_view("\n\r\0", 3)) == std::string::npos;
  if (!one_line || view.name.starts_with(' ') || view.name.starts_with('\t')) {
    return InvalidArgument(
        "\"{}\" cannot be a name in COLMAP's text: it begins with a space or has "
        "a line break",
        view.name);
  }
  TILEGRAD_TRY(Validate(view.camera).Within(view.name));  // a quaternion would hide a mirror
  return FromColmap(camera).status().Within(view.name);
}

}  // namespace

std::vector<Path> ColmapFiles(const Path& folder) {
  return {folder / "cameras.txt", folder / "points3D.txt", folder / "images.txt"};
}

Status SaveColmapCameras(const Path& folder, std::span<const CameraView> views) {
  if (views.empty()) return InvalidArgument("{}: no views to write", folder.string());
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const ColmapCamera c = ToColmap(views[i].camera);
    TILEGRAD_TRY(CheckForColmap(views[i], c).Within(folder.string()));
    const auto& [q, t, fx, fy, cx, cy] = c;
    cameras += fmt::format("{} PINHOLE {} {} {} {} {} {}\n", i + 1, views[i].size.width,
                           views[i].size.height, fx, fy, cx, cy);
    images += fmt::format("{} {} {} {} {} {} {} {} {} {}\n\n", i + 1, q[0], q[1], q[2], q[3], t[0],
                          t[1], t[2], i + 1, views[i].name);
  }
  const std::vector<Path> files = ColmapFiles(folder);
  TILEGRAD_TRY(WriteTextAtomic(files[0], cameras));
  TILEGRAD_TRY(WriteTextAtomic(files[1], "# none\n"));
  return WriteTextAtomic(files[2], images);
}

}  // namespace tilegrad::io

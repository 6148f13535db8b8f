// SPDX-License-Identifier: Apache-2.0
// Cameras to JSON: NeRF's transforms.json, and OpenCV's numbers.
#include <array>
#include <cmath>

#include "base/json_text.h"
#include "io/camera_file.h"
#include "io/json_cameras.h"

namespace tilegrad::io {

using nlohmann::json;

namespace {

template <std::size_t N>
json Rows(const std::array<double, N>& m, std::size_t columns) {
  json rows = json::array();
  for (std::size_t i = 0; i < N; i += columns) {
    rows.push_back(std::vector<double>(m.begin() + static_cast<std::ptrdiff_t>(i),
                                       m.begin() + static_cast<std::ptrdiff_t>(i + columns)));
  }
  return rows;
}

// What the reader refuses is not written: no frames, sizes, numbers that JSON has no word for.
Status SaveJson(const Path& file, const json& top) {
  const std::string text = JsonText(top, 1) + "\n";
  const auto back = ReadJsonCameras(text, file, {});
  if (!back.ok()) {
    return InvalidArgument("{}; nothing was written, because it could not be read back",
                           back.status().message());
  }
  return WriteTextAtomic(file, text);
}

}  // namespace

Status SaveNerfCameras(const Path& file, std::span<const CameraView> views) {
  json frames = json::array();
  for (const CameraView& view : views) {
    if (view.name.find('\\') != std::string::npos) {
      return InvalidArgument("{}: \"{}\" has a backslash, which transforms.json takes for a slash",
                             file.string(), view.name);
    }
    const NerfCamera c = ToNerf(view.camera);
    frames.push_back({{"file_path", view.name},
                      {"w", view.size.width},
                      {"h", view.size.height},
                      {"fl_x", c.fl_x},
                      {"fl_y", c.fl_y},
                      {"cx", c.cx},
                      {"cy", c.cy},
                      {"transform_matrix", Rows(c.camera_to_world, 4)}});
  }
  json top{{"camera_model", "PINHOLE"}, {"frames", frames}};
  if (!views.empty()) {  // the only keys that readers of the first datasets know
    top["camera_angle_x"] = 2 * std::atan(0.5 * views[0].size.width / views[0].camera.fx);
  }
  return SaveJson(file, top);
}

Status SaveOpenCvCameras(const Path& file, std::span<const CameraView> views) {
  json frames = json::array();
  for (const CameraView& view : views) {
    const OpenCvCamera c = ToOpenCv(view.camera);
    frames.push_back({{"name", view.name},
                      {"width", view.size.width},
                      {"height", view.size.height},
                      {"K", Rows(c.k, 3)},
                      {"R", Rows(c.rotation, 3)},
                      {"t", c.translation}});
  }
  return SaveJson(file, json{{"frames", frames}});
}

}  // namespace tilegrad::io

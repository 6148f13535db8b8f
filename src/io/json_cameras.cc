// SPDX-License-Identifier: Apache-2.0
// Cameras in JSON, read and written: NeRF's transforms.json, and OpenCV's numbers.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "base/file.h"
#include "base/json_text.h"
#include "io/camera_file.h"
#include "io/json_frame.h"
#include "io/nerf_frames.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

// Refuses coefficients of distortion that are not 0.
Status CheckNoDistortion(const JsonFrame& frame) {
  for (const char* key : {"dist", "distCoeffs"}) {
    const json* value = frame.Find(key);
    const auto zero = [](const json& x) { return x.is_number() && x.get<double>() == 0; };
    if (value == nullptr || zero(*value)) continue;
    if (value->is_array() && std::all_of(value->begin(), value->end(), zero)) continue;
    return InvalidArgument(
        "{}: lens distortion (\"{}\"); undistort the images first (cv::undistort, colmap "
        "image_undistorter) and use the cameras of those",
        frame.place, key);
  }
  return {};
}

// The size that is written, or else the one that was given.
Result<ImageSize> SizeOr(Result<ImageSize> written, ImageSize given, const std::string& place,
                         const char* keys) {
  if (!written.ok() || written->width > 0) return written;
  if (given.width > 0 && given.height > 0) return given;
  return InvalidArgument("{}: {} are missing; give the size of the images", place, keys);
}

Status OpenCvPose(const JsonFrame& frame, OpenCvCamera* out) {
  if (frame.Find("world_to_camera") != nullptr) {
    TILEGRAD_ASSIGN(const auto m, frame.Numbers("world_to_camera"));
    if (m.size() != 12 && m.size() != 16)
      return DataLoss("{}: \"world_to_camera\" has {} numbers, not 12 or 16", frame.place,
                      m.size());
    if (m.size() == 16 && (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1))
      return DataLoss("{}: the last row of \"world_to_camera\" is not 0 0 0 1", frame.place);
    out->rotation = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
    out->translation = {m[3], m[7], m[11]};
    return {};
  }
  if (frame.Find("rvec") != nullptr) {
    TILEGRAD_ASSIGN(const Vec3Array rvec, frame.Array<3>("rvec"));
    out->rotation = RotationFromVector(rvec);
  } else {
    TILEGRAD_ASSIGN(out->rotation, frame.Array<9>("R"));
  }
  TILEGRAD_ASSIGN(out->translation, frame.Array<3>(frame.Find("tvec") ? "tvec" : "t"));
  return {};
}

Result<CameraView> OpenCvView(const JsonFrame& frame, std::size_t index,
                              const CameraFileOptions& options) {
  TILEGRAD_TRY(CheckNoDistortion(frame));
  TILEGRAD_ASSIGN(const ImageSize size, SizeOr(frame.Size("width", "height"), options.size,
                                               frame.place, "\"width\" and \"height\""));
  OpenCvCamera from;
  from.centre = options.opencv_centre;
  TILEGRAD_ASSIGN(from.k, frame.Array<9>("K"));
  TILEGRAD_TRY(OpenCvPose(frame, &from));
  const auto camera = FromOpenCv(from);
  if (!camera.ok()) return DataLoss("{}: {}", frame.place, camera.status().message());
  return CameraView{frame.Text("name").value_or(std::to_string(index)), *camera, size};
}

bool HasK(const json& top) {
  const auto frames = top.find("frames");
  return top.contains("K") || (frames != top.end() && frames->is_array() && !frames->empty() &&
                               frames->front().is_object() && frames->front().contains("K"));
}

Result<std::vector<CameraView>> OpenCvViews(const json& top, const Path& file,
                                            const CameraFileOptions& options) {
  TILEGRAD_ASSIGN(const auto frames, JsonFrames(top, file));
  std::vector<CameraView> views;
  for (const JsonFrame& frame : frames) {
    TILEGRAD_ASSIGN(CameraView view, OpenCvView(frame, views.size(), options));
    views.push_back(std::move(view));
  }
  return views;
}

Result<std::vector<CameraView>> NerfViews(const std::vector<NerfFrame>& frames, ImageSize given) {
  std::vector<CameraView> views;
  for (const NerfFrame& frame : frames) {
    TILEGRAD_TRY(CheckStraight(frame.lens).Within(frame.place));
    TILEGRAD_ASSIGN(const ImageSize size, SizeOr(frame.size.value_or(ImageSize()), given,
                                                 frame.place, "\"w\" and \"h\""));
    TILEGRAD_ASSIGN(const Camera64 camera, CameraOf(frame, size));
    const std::string name = frame.image.value_or(std::to_string(views.size()));
    views.push_back({PortablePath(name), camera, size});
  }
  return views;
}

// As LoadCameras of a file. `file` stands in messages.
Result<std::vector<CameraView>> ReadJsonCameras(const std::string& text, const Path& file,
                                                const CameraFileOptions& options) {
  TILEGRAD_ASSIGN(const json top, ParseJsonObject(text, file));
  if (HasK(top)) return OpenCvViews(top, file, options);
  TILEGRAD_ASSIGN(const auto frames, NerfFramesOf(top, file));
  return NerfViews(frames, options.size);
}

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

Result<std::vector<CameraView>> LoadCameras(const Path& path, const CameraFileOptions& options) {
  if (IsFolder(path)) return LoadColmapCameras(path, options);
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  return ReadJsonCameras(text, path, options);
}

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

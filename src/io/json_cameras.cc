// SPDX-License-Identifier: Apache-2.0
// Cameras in JSON: NeRF's transforms.json, and OpenCV's numbers.
#include "io/json_cameras.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "io/camera_file.h"
#include "io/transforms_lens.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

Result<json> ParseJson(const std::string& text, const Path& file) {
  json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded()) return DataLoss("{}: not valid JSON", file.string());
  if (!parsed.is_object()) return DataLoss("{}: not a JSON object", file.string());
  return parsed;
}

// A frame of a file: what it omits is taken from the top level.
struct Frame {
  const json& frame;
  const json& top;
  std::string place;

  const json* Find(const char* key) const {
    for (const json* object : {&frame, &top}) {
      const auto found = object->find(key);
      if (found != object->end() && !found->is_null()) return &*found;
    }
    return nullptr;
  }
  Result<double> Number(const char* key) const {
    const json* value = Find(key);
    if (value == nullptr) return DataLoss("{}: \"{}\" is missing", place, key);
    if (!value->is_number()) return DataLoss("{}: \"{}\" is not a number", place, key);
    return value->get<double>();
  }
  // Of rows or flat; `count` numbers.
  Result<std::vector<double>> Numbers(const char* key) const;
  Result<ImageSize> Size(const char* width, const char* height, ImageSize fallback) const;
  // Refuses any of these that is there and not 0.
  Status NoDistortion(std::span<const char* const> keys) const;
  std::string Name(const char* key, std::size_t index) const {
    const auto found = frame.find(key);
    return found != frame.end() && found->is_string() ? found->get<std::string>()
                                                      : std::to_string(index);
  }
};

Result<std::vector<double>> Frame::Numbers(const char* key) const {
  const json* value = Find(key);
  if (value == nullptr) return DataLoss("{}: \"{}\" is missing", place, key);
  std::vector<double> out;
  const auto add = [&](const json& x) {
    if (x.is_number()) out.push_back(x.get<double>());
    return x.is_number();
  };
  bool good = value->is_array();
  for (std::size_t i = 0; good && i < value->size(); ++i) {
    const json& row = (*value)[i];
    good = row.is_array() ? std::all_of(row.begin(), row.end(), add) : add(row);
  }
  if (!good) return DataLoss("{}: \"{}\" is not an array of numbers", place, key);
  return out;
}

template <std::size_t N>
Result<std::array<double, N>> ArrayOf(const Frame& frame, const char* key) {
  TILEGRAD_ASSIGN(const auto numbers, frame.Numbers(key));
  if (numbers.size() != N) {
    return DataLoss("{}: \"{}\" has {} numbers, not {}", frame.place, key, numbers.size(), N);
  }
  std::array<double, N> out;
  std::copy(numbers.begin(), numbers.end(), out.begin());
  return out;
}

Result<ImageSize> Frame::Size(const char* width, const char* height, ImageSize fallback) const {
  if (Find(width) == nullptr && Find(height) == nullptr) {
    if (fallback.width > 0 && fallback.height > 0) return fallback;
    return InvalidArgument("{}: \"{}\" and \"{}\" are missing; give the size of the images", place,
                           width, height);
  }
  TILEGRAD_ASSIGN(const double w, Number(width));
  TILEGRAD_ASSIGN(const double h, Number(height));
  constexpr double kMaxSide = 1 << 20;
  if (!(w >= 1 && h >= 1 && w <= kMaxSide && h <= kMaxSide) || w != std::floor(w) ||
      h != std::floor(h)) {
    return DataLoss("{}: an image of {} x {} pixels", place, w, h);
  }
  return ImageSize{static_cast<int>(w), static_cast<int>(h)};
}

Status Frame::NoDistortion(std::span<const char* const> keys) const {
  for (const char* key : keys) {
    const json* value = Find(key);
    if (value == nullptr) continue;
    const bool zero = value->is_number()
                          ? value->get<double>() == 0
                          : std::all_of(value->begin(), value->end(), [](const json& x) {
                              return x.is_number() && x.get<double>() == 0;
                            });
    if (!zero) {
      return InvalidArgument(
          "{}: lens distortion (\"{}\"); undistort the images first (cv::undistort, colmap "
          "image_undistorter) and use the cameras of those",
          place, key);
    }
  }
  return {};
}

// Calls convert(frame, index) for each frame, or for the top where there are none.
template <class Convert>
Result<std::vector<CameraView>> EachFrame(const json& top, const Path& file,
                                          const Convert& convert) {
  std::vector<CameraView> views;
  const auto add = [&](const json& frame, std::size_t index, std::string place) -> Status {
    if (!frame.is_object()) return DataLoss("{}: not a JSON object", place);
    auto view = convert(Frame{frame, top, place}, index);
    if (!view.ok()) return view.status();
    views.push_back(std::move(view).value());
    return {};
  };
  const auto frames = top.find("frames");
  if (frames == top.end()) {
    TILEGRAD_TRY(add(top, 0, file.string()));
    return views;
  }
  if (!frames->is_array() || frames->empty())
    return DataLoss("{}: \"frames\" is not an array with something in it", file.string());
  for (std::size_t i = 0; i < frames->size(); ++i) {
    TILEGRAD_TRY(add((*frames)[i], i, fmt::format("{}: frame {}", file.string(), i)));
  }
  return views;
}

Result<CameraView> Named(std::string name, const Result<Camera64>& camera, ImageSize size,
                         const std::string& place) {
  if (!camera.ok()) return DataLoss("{}: {}", place, camera.status().message());
  return CameraView{std::move(name), *camera, size};
}

// The focal length across `pixels`: given in pixels, or as the whole field of view in radians.
Result<double> NerfFocal(const Frame& frame, const char* focal, const char* angle, int pixels) {
  if (frame.Find(focal) != nullptr) return frame.Number(focal);
  TILEGRAD_ASSIGN(const double radians, frame.Number(angle));
  if (!(radians > 0 && radians < std::numbers::pi)) {
    return DataLoss("{}: \"{}\" is {}; a field of view is above 0 and below pi (radians)",
                    frame.place, angle, radians);
  }
  return 0.5 * pixels / std::tan(0.5 * radians);
}

Result<CameraView> NerfView(const Frame& frame, std::size_t index,
                            const CameraFileOptions& options) {
  TILEGRAD_TRY(CheckPinhole(frame.top, frame.frame).Within(frame.place));
  TILEGRAD_ASSIGN(const ImageSize size, frame.Size("w", "h", options.size));
  NerfCamera from;
  TILEGRAD_ASSIGN(from.camera_to_world, ArrayOf<16>(frame, "transform_matrix"));
  TILEGRAD_ASSIGN(from.fl_x, NerfFocal(frame, "fl_x", "camera_angle_x", size.width));
  from.fl_y = from.fl_x;
  if (frame.Find("fl_y") != nullptr || frame.Find("camera_angle_y") != nullptr) {
    TILEGRAD_ASSIGN(from.fl_y, NerfFocal(frame, "fl_y", "camera_angle_y", size.height));
  }
  from.cx = 0.5 * size.width, from.cy = 0.5 * size.height;
  if (frame.Find("cx") != nullptr) {
    TILEGRAD_ASSIGN(from.cx, frame.Number("cx"));
  }
  if (frame.Find("cy") != nullptr) {
    TILEGRAD_ASSIGN(from.cy, frame.Number("cy"));
  }
  return Named(PortablePath(frame.Name("file_path", index)), FromNerf(from), size, frame.place);
}

Status OpenCvPose(const Frame& frame, OpenCvCamera* out) {
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
    TILEGRAD_ASSIGN(const Vec3Array rvec, ArrayOf<3>(frame, "rvec"));
    out->rotation = RotationFromVector(rvec);
  } else {
    TILEGRAD_ASSIGN(out->rotation, ArrayOf<9>(frame, "R"));
  }
  TILEGRAD_ASSIGN(out->translation, ArrayOf<3>(frame, frame.Find("tvec") ? "tvec" : "t"));
  return {};
}

Result<CameraView> OpenCvView(const Frame& frame, std::size_t index,
                              const CameraFileOptions& options) {
  constexpr std::array<const char*, 2> kDistortion = {"dist", "distCoeffs"};
  TILEGRAD_TRY(frame.NoDistortion(kDistortion));
  TILEGRAD_ASSIGN(const ImageSize size, frame.Size("width", "height", options.size));
  OpenCvCamera from;
  from.centre = options.opencv_centre;
  TILEGRAD_ASSIGN(from.k, ArrayOf<9>(frame, "K"));
  TILEGRAD_TRY(OpenCvPose(frame, &from));
  return Named(frame.Name("name", index), FromOpenCv(from), size, frame.place);
}

bool HasK(const json& top) {
  const auto frames = top.find("frames");
  return top.contains("K") || (frames != top.end() && frames->is_array() && !frames->empty() &&
                               frames->front().is_object() && frames->front().contains("K"));
}

Result<std::vector<CameraView>> NerfViews(const json& top, const Path& file,
                                          const CameraFileOptions& options) {
  return EachFrame(top, file,
                   [&](const Frame& frame, std::size_t i) { return NerfView(frame, i, options); });
}

Result<std::vector<CameraView>> OpenCvViews(const json& top, const Path& file,
                                            const CameraFileOptions& options) {
  return EachFrame(
      top, file, [&](const Frame& frame, std::size_t i) { return OpenCvView(frame, i, options); });
}

}  // namespace

Result<std::vector<CameraView>> ReadJsonCameras(const std::string& text, const Path& file,
                                                const CameraFileOptions& options) {
  TILEGRAD_ASSIGN(const json top, ParseJson(text, file));
  return HasK(top) ? OpenCvViews(top, file, options) : NerfViews(top, file, options);
}

Result<std::vector<CameraView>> LoadCameras(const Path& path, const CameraFileOptions& options) {
  if (IsFolder(path)) return LoadColmapCameras(path);
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  return ReadJsonCameras(text, path, options);
}

}  // namespace tilegrad::io

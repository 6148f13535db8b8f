// SPDX-License-Identifier: Apache-2.0
// Reads and writes cameras in JSON: NeRF's transforms.json, and OpenCV parameters.
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/text.h"
#include "io/camera_file.h"
#include "scene/camera.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

// A frame of the file with its top level, from which it inherits what it omits. null counts as
// absent. Errors begin with `place`.
struct JsonFrame {
  const json& frame;
  const json& top;
  std::string place;

  static const json* FindIn(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && !found->is_null() ? &*found : nullptr;
  }
  const json* Find(const char* key) const {
    const json* own = FindIn(frame, key);
    return own != nullptr ? own : FindIn(top, key);
  }

  Result<double> Number(const char* key) const {
    const json* value = Find(key);
    if (value == nullptr) return DataLoss("{}: \"{}\" is missing", place, key);
    if (!value->is_number()) return DataLoss("{}: \"{}\" is not a number", place, key);
    return value->get<double>();
  }

  // Nested by rows or flat.
  Result<std::vector<double>> Numbers(const char* key) const {
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
  Result<std::array<double, N>> Array(const char* key) const {
    TILEGRAD_ASSIGN(const auto numbers, Numbers(key));
    if (numbers.size() != N)
      return DataLoss("{}: \"{}\" has {} numbers, not {}", place, key, numbers.size(), N);
    std::array<double, N> out;
    std::copy(numbers.begin(), numbers.end(), out.begin());
    return out;
  }
  // Of the image; 0 x 0 if both are absent.
  Result<ImageSize> Size(const char* width, const char* height) const {
    if (Find(width) == nullptr && Find(height) == nullptr) return ImageSize();
    TILEGRAD_ASSIGN(const double w, Number(width));
    TILEGRAD_ASSIGN(const double h, Number(height));
    constexpr double kMostSide = 1 << 20;
    if (!(w >= 1 && h >= 1 && w <= kMostSide && h <= kMostSide) || w != std::floor(w) ||
        h != std::floor(h)) {
      return DataLoss("{}: an image of {} x {} pixels", place, w, h);
    }
    return ImageSize{static_cast<int>(w), static_cast<int>(h)};
  }

  // The frame's own; nullopt if it is no text.
  std::optional<std::string> Text(const char* key) const {
    const json* value = FindIn(frame, key);
    if (value == nullptr || !value->is_string()) return std::nullopt;
    return value->get<std::string>();
  }
};

// An object, or an error that names the file.
Result<json> ParseJsonObject(const std::string& text, const Path& file) {
  TILEGRAD_ASSIGN(json parsed, ParseJson(text, file.string()));
  if (!parsed.is_object()) return DataLoss("{}: not a JSON object", file.string());
  return parsed;
}

// Its "frames", or the file itself if there are none.
Result<std::vector<JsonFrame>> JsonFrames(const json& top, const Path& file) {
  const json* frames = JsonFrame::FindIn(top, "frames");
  if (frames == nullptr) return std::vector<JsonFrame>{{top, top, file.string()}};
  if (!frames->is_array() || frames->empty())
    return DataLoss("{}: \"frames\" is not an array with something in it", file.string());
  std::vector<JsonFrame> out;
  for (const json& frame : *frames) {
    out.push_back({frame, top, fmt::format("{}: frame {}", file.string(), out.size())});
    if (!frame.is_object()) return DataLoss("{}: not a JSON object", out.back().place);
  }
  return out;
}

constexpr std::array<std::string_view, 7> kBrownModels = {
    "pinhole", "simple_pinhole", "simple_radial", "radial", "opencv", "full_opencv", "perspective"};
constexpr std::array<std::string_view, 3> kFisheyeModels = {"opencv_fisheye", "radial_fisheye",
                                                            "simple_radial_fisheye"};
constexpr std::array<const char*, 2> kFisheyeFlags = {"is_fisheye", "fisheye"};
constexpr std::array<const char*, 6> kOtherFlags = {
    "equirectangular", "latlong", "spherical", "orthographic", "is_orthographic", "is_spherical"};
// In the order of LensDistortion. nerfstudio's k4 without a model differs from OpenCV's.
constexpr std::array<const char*, 5> kBrown = {"k1", "k2", "p1", "p2", "k3"};
constexpr std::array<const char*, 8> kFullBrown = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
constexpr std::array<const char*, 4> kFisheye = {"k1", "k2", "k3", "k4"};
constexpr std::array<const char*, 18> kCoefficients = {
    "k1",        "k2",        "k3",        "k4",        "k5",        "k6",
    "p1",        "p2",        "p3",        "p4",        "s1",        "s2",
    "ftheta_p0", "ftheta_p1", "ftheta_p2", "ftheta_p3", "ftheta_p4", "distortion_params"};
constexpr const char* kAdvice =
    "undistort the images first (colmap image_undistorter, cv::undistort) and use the cameras of "
    "those";

bool IsZero(const json& value) {
  if (value.is_boolean()) return !value.get<bool>();
  if (value.is_number()) return value.get<double>() == 0;
  return value.is_array() && std::all_of(value.begin(), value.end(), IsZero);
}

bool IsSet(const JsonFrame& frame, const char* key) {
  const json* value = frame.Find(key);
  return value != nullptr && !IsZero(*value);
}

template <class Names>
bool IsAmong(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// In lower case; empty if the file has none.
std::string ModelOf(const JsonFrame& frame) {
  const json* model = frame.Find("camera_model");
  if (model == nullptr) return "";
  return LowerCase(model->is_string() ? model->get<std::string>() : model->dump());
}

Status CheckModel(const JsonFrame& frame, const std::string& model) {
  if (!model.empty() && !IsAmong(kBrownModels, model) && !IsAmong(kFisheyeModels, model))
    return InvalidArgument("{}: \"camera_model\" is {}: {}", frame.place,
                           frame.Find("camera_model")->dump(), kAdvice);
  for (const char* flag : kOtherFlags) {
    if (IsSet(frame, flag))
      return InvalidArgument("{}: \"{}\" is {}: {}", frame.place, flag, frame.Find(flag)->dump(),
                             kAdvice);
  }
  return {};
}

// Takes the numbers with these names into `first`, ...; no other coefficient may occur.
template <class Names>
Status TakeCoefficients(const JsonFrame& frame, const Names& names, double* first) {
  for (const char* key : names) {
    const json* value = frame.Find(key);
    if (value != nullptr && value->is_number()) *first = value->get<double>();
    ++first;
  }
  for (const char* key : kCoefficients) {
    const json* value = frame.Find(key);
    const bool taken =
        IsAmong(names, std::string_view(key)) && value != nullptr && value->is_number();
    if (value != nullptr && !taken && !IsZero(*value))
      return InvalidArgument("{}: lens distortion (\"{}\"): {}", frame.place, key, kAdvice);
  }
  return {};
}

// From camera_model of nerfstudio and COLMAP, the flags of instant-ngp, and the distortion
// coefficients. An error names the key of a lens that lens_distortion.h does not support.
Result<LensDistortion> LensOf(const JsonFrame& frame) {
  const std::string model = ModelOf(frame);
  TILEGRAD_TRY(CheckModel(frame, model));
  std::array<double, 8> k = {};
  const bool flagged = std::ranges::any_of(kFisheyeFlags, [&](auto* f) { return IsSet(frame, f); });
  if (flagged || IsAmong(kFisheyeModels, model)) {
    TILEGRAD_TRY(TakeCoefficients(frame, kFisheye, k.data()));
    return FisheyeLens({k[0], k[1], k[2], k[3]});
  }
  TILEGRAD_TRY(model == "full_opencv" ? TakeCoefficients(frame, kFullBrown, k.data())
                                      : TakeCoefficients(frame, kBrown, k.data()));
  return BrownLens(k);
}

Status ReadOptional(const JsonFrame& frame, const char* key, std::optional<double>* out) {
  if (frame.Find(key) == nullptr) return {};
  TILEGRAD_ASSIGN(*out, frame.Number(key));
  return {};
}

// Of the frame if it has any of them, else of the file.
Status ReadFocals(const JsonFrame& frame, NerfFrame* out) {
  for (const json* level : {&frame.frame, &frame.top}) {
    const JsonFrame alone{*level, *level, frame.place};
    TILEGRAD_TRY(ReadOptional(alone, "fl_x", &out->fl_x));
    TILEGRAD_TRY(ReadOptional(alone, "fl_y", &out->fl_y));
    TILEGRAD_TRY(ReadOptional(alone, "camera_angle_x", &out->angle_x));
    TILEGRAD_TRY(ReadOptional(alone, "camera_angle_y", &out->angle_y));
    if (out->fl_x || out->fl_y || out->angle_x || out->angle_y) return {};
  }
  return {};
}

Status ReadNames(const JsonFrame& frame, NerfFrame* out) {
  out->image = frame.Text("file_path");
  out->mask = frame.Text("mask_path");
  if (JsonFrame::FindIn(frame.frame, "mask_path") == nullptr || out->mask) return {};
  return DataLoss("{}: \"mask_path\" is not a string", frame.place);
}

Status ReadPose(const JsonFrame& frame, NerfFrame* out) {
  TILEGRAD_TRY(ReadFocals(frame, out));
  const bool focal = out->fl_x || out->fl_y || out->angle_x || out->angle_y;
  if (!focal || frame.Find("transform_matrix") == nullptr) {
    return DataLoss(
        "{}: needs \"transform_matrix\", and \"camera_angle_x\" or \"fl_x\" here or for all "
        "frames",
        frame.place);
  }
  TILEGRAD_ASSIGN(out->camera_to_world, frame.Array<16>("transform_matrix"));
  TILEGRAD_TRY(ReadOptional(frame, "cx", &out->cx));
  return ReadOptional(frame, "cy", &out->cy);
}

Result<NerfFrame> ReadFrame(const JsonFrame& frame) {
  NerfFrame out;
  out.place = frame.place;
  TILEGRAD_ASSIGN(out.lens, LensOf(frame));
  TILEGRAD_TRY(ReadNames(frame, &out));
  TILEGRAD_ASSIGN(const ImageSize size, frame.Size("w", "h"));
  if (size.width > 0) out.size = size;
  TILEGRAD_TRY(ReadPose(frame, &out));
  return out;
}

// Along one axis with this many pixels: given, or from an angle; nullopt if neither exists.
Result<std::optional<double>> FocalOf(const NerfFrame& frame, char axis, int pixels) {
  const auto& focal = axis == 'x' ? frame.fl_x : frame.fl_y;
  const auto& angle = axis == 'x' ? frame.angle_x : frame.angle_y;
  if (focal || !angle) return focal;
  if (!(*angle > 0 && *angle < std::numbers::pi)) {
    return DataLoss(
        "{}: \"camera_angle_{}\" is {}; a field of view is above 0 and below pi (radians)",
        frame.place, axis, *angle);
  }
  return std::optional(0.5 * pixels / std::tan(0.5 * *angle));
}

Result<std::vector<NerfFrame>> NerfFramesOf(const std::vector<JsonFrame>& frames) {
  std::vector<NerfFrame> out;
  for (const JsonFrame& frame : frames) {
    TILEGRAD_ASSIGN(NerfFrame read, ReadFrame(frame));
    out.push_back(std::move(read));
  }
  return out;
}

// Refuses nonzero distortion coefficients.
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

// The size in the file, or else the given one.
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

Result<std::vector<CameraView>> OpenCvViews(const std::vector<JsonFrame>& frames,
                                            const CameraFileOptions& options) {
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

// Like LoadCameras, for a file's text. Messages call it `file`.
Result<std::vector<CameraView>> ReadJsonCameras(const std::string& text, const Path& file,
                                                const CameraFileOptions& options) {
  TILEGRAD_ASSIGN(const json top, ParseJsonObject(text, file));
  TILEGRAD_ASSIGN(const auto frames, JsonFrames(top, file));
  if (frames.front().Find("K") != nullptr) return OpenCvViews(frames, options);
  TILEGRAD_ASSIGN(const auto nerf, NerfFramesOf(frames));
  return NerfViews(nerf, options.size);
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

// Refuses what the reader would: no frames, sizes, numbers that JSON cannot express.
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

Result<std::vector<NerfFrame>> ReadNerfFrames(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  TILEGRAD_ASSIGN(const json top, ParseJsonObject(text, file));
  TILEGRAD_ASSIGN(const auto frames, JsonFrames(top, file));
  return NerfFramesOf(frames);
}

Result<Camera64> CameraOf(const NerfFrame& frame, ImageSize size) {
  TILEGRAD_ASSIGN(const auto x, FocalOf(frame, 'x', size.width));
  TILEGRAD_ASSIGN(const auto y, FocalOf(frame, 'y', size.height));
  NerfCamera from;  // pixels are square if one of the two is unknown
  from.camera_to_world = frame.camera_to_world;
  from.fl_x = x.value_or(y.value_or(0));
  from.fl_y = y.value_or(from.fl_x);
  from.cx = frame.cx.value_or(0.5 * size.width);
  from.cy = frame.cy.value_or(0.5 * size.height);
  const auto camera = FromNerf(from);
  if (!camera.ok()) return DataLoss("{}: {}", frame.place, camera.status().message());
  return *camera;
}

std::string PortablePath(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  return path;
}

Status CheckStraight(const LensDistortion& lens) {
  if (lens.straight()) return {};
  return InvalidArgument("the lens is distorted, and only `tilegrad fit` undistorts images: {}",
                         kAdvice);
}

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

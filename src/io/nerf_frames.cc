// SPDX-License-Identifier: Apache-2.0
#include "io/nerf_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "io/camera_file.h"
#include "io/json_frame.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

constexpr std::array<std::string_view, 7> kBrownModels = {
    "pinhole", "simple_pinhole", "simple_radial", "radial", "opencv", "full_opencv", "perspective"};
constexpr std::array<std::string_view, 3> kFisheyeModels = {"opencv_fisheye", "radial_fisheye",
                                                            "simple_radial_fisheye"};
constexpr std::array<const char*, 2> kFisheyeFlags = {"is_fisheye", "fisheye"};
constexpr std::array<const char*, 6> kOtherFlags = {
    "equirectangular", "latlong", "spherical", "orthographic", "is_orthographic", "is_spherical"};
// In the order of LensDistortion. nerfstudio's k4 without a model is another one than OpenCV's.
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

// In small letters; empty where the file says none.
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

// Numbers of these names from `first` on, and no other coefficient.
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

// By camera_model of nerfstudio and COLMAP, the flags of instant-ngp, and the coefficients of
// distortion. An error names the key of what is no lens of lens_distortion.h.
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

// Of the frame if it has any of these, else of the file.
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

// Along one axis of so many pixels: given, or as an angle; nothing if neither is there.
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

}  // namespace

Result<std::vector<NerfFrame>> NerfFramesOf(const json& top, const Path& file) {
  TILEGRAD_ASSIGN(const auto frames, JsonFrames(top, file));
  std::vector<NerfFrame> out;
  for (const JsonFrame& frame : frames) {
    TILEGRAD_ASSIGN(NerfFrame read, ReadFrame(frame));
    out.push_back(std::move(read));
  }
  return out;
}

Result<std::vector<NerfFrame>> ReadNerfFrames(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  TILEGRAD_ASSIGN(const json top, ParseJsonObject(text, file));
  return NerfFramesOf(top, file);
}

Result<Camera64> CameraOf(const NerfFrame& frame, ImageSize size) {
  TILEGRAD_ASSIGN(const auto x, FocalOf(frame, 'x', size.width));
  TILEGRAD_ASSIGN(const auto y, FocalOf(frame, 'y', size.height));
  NerfCamera from;  // pixels are square where one of the two is not known
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

}  // namespace tilegrad::io

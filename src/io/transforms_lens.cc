// SPDX-License-Identifier: Apache-2.0
#include "io/transforms_lens.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "base/text.h"

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

}  // namespace

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

Status CheckStraight(const LensDistortion& lens) {
  if (lens.straight()) return {};
  return InvalidArgument("the lens is distorted, and only `tilegrad fit` undistorts images: {}",
                         kAdvice);
}

}  // namespace tilegrad::io

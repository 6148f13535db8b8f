// SPDX-License-Identifier: Apache-2.0
#include "io/transforms_lens.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

// Straight if their coefficients are 0.
constexpr std::array<std::string_view, 7> kStraight = {
    "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "PERSPECTIVE"};
constexpr std::array<const char*, 8> kFlags = {"is_fisheye",      "fisheye",     "equirectangular",
                                               "latlong",         "spherical",   "orthographic",
                                               "is_orthographic", "is_spherical"};
constexpr std::array<const char*, 18> kCoefficients = {"k1",
                                                       "k2",
                                                       "k3",
                                                       "k4",
                                                       "k5",
                                                       "k6",
                                                       "p1",
                                                       "p2",
                                                       "p3",
                                                       "p4",
                                                       "s1",
                                                       "ftheta_p0",
                                                       "ftheta_p1",
                                                       "ftheta_p2",
                                                       "ftheta_p3",
                                                       "ftheta_p4",
                                                       "distortion_params",
                                                       "s2"};
constexpr const char* kAdvice =
    "undistort the images first (colmap image_undistorter, cv::undistort) and use the cameras of "
    "those: the camera here is a pinhole";

const json* Find(const json& top, const json& frame, const char* key) {
  for (const json* object : {&frame, &top}) {
    const auto found = object->find(key);
    if (found != object->end() && !found->is_null()) return &*found;
  }
  return nullptr;
}

bool IsZero(const json& value) {
  if (value.is_boolean()) return !value.get<bool>();
  if (value.is_number()) return value.get<double>() == 0;
  return value.is_array() && std::all_of(value.begin(), value.end(), IsZero);
}

}  // namespace

Status CheckPinhole(const json& top, const json& frame) {
  if (const json* model = Find(top, frame, "camera_model")) {
    std::string name = model->is_string() ? model->get<std::string>() : model->dump();
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    if (std::find(kStraight.begin(), kStraight.end(), name) == kStraight.end())
      return InvalidArgument("\"camera_model\" is {}: {}", name, kAdvice);
  }
  for (const char* flag : kFlags) {
    const json* value = Find(top, frame, flag);
    if (value != nullptr && !IsZero(*value))
      return InvalidArgument("\"{}\" is {}: {}", flag, value->dump(), kAdvice);
  }
  for (const char* key : kCoefficients) {
    const json* value = Find(top, frame, key);
    if (value != nullptr && !IsZero(*value))
      return InvalidArgument("lens distortion (\"{}\"): {}", key, kAdvice);
  }
  return {};
}

std::string PortablePath(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  return path;
}

}  // namespace tilegrad::io

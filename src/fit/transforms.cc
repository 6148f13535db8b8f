// SPDX-License-Identifier: Apache-2.0
#include "fit/transforms.h"

#include <algorithm>
#include <cmath>

#include "base/file.h"
#include "io/transforms_lens.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::json;

// `key` of the frame or, if it has none, of the whole file; 0 if neither has it.
Status ReadNumber(const Json& file, const Json& frame, const char* key, double* out) {
  const Json& owner = frame.contains(key) ? frame : file;
  if (!owner.contains(key)) return {};
  if (!owner[key].is_number()) return DataLoss("\"{}\" must be a number", key);
  *out = owner[key].get<double>();
  return {};
}

Status ReadIntrinsics(const Json& file, const Json& frame, TransformsFrame* out) {
  double width = 0, height = 0;
  const std::pair<const char*, double*> numbers[] = {{"fl_x", &out->pose.fl_x},
                                                     {"fl_y", &out->pose.fl_y},
                                                     {"cx", &out->pose.cx},
                                                     {"cy", &out->pose.cy},
                                                     {"camera_angle_x", &out->angle_x},
                                                     {"camera_angle_y", &out->angle_y},
                                                     {"w", &width},
                                                     {"h", &height}};
  for (const auto& [key, number] : numbers) TILEGRAD_TRY(ReadNumber(file, frame, key, number));
  TILEGRAD_TRY(io::CheckPinhole(file, frame));
  if (out->pose.fl_x == 0 && out->angle_x == 0) {
    return DataLoss("needs \"camera_angle_x\" or \"fl_x\", here or for all frames");
  }
  constexpr double kMostSide = 1 << 20;
  if (!(width >= 0 && width <= kMostSide && height >= 0 && height <= kMostSide)) {
    return DataLoss("\"w\" and \"h\" must be pixels");
  }
  out->size = {static_cast<int>(width), static_cast<int>(height)};
  return {};
}

Status ReadPose(const Json& frame, NerfCamera* out) {
  const auto at = frame.find("transform_matrix");
  const char* const shape = "\"transform_matrix\" must be four rows of four numbers";
  if (at == frame.end() || !at->is_array() || at->size() != 4) return DataLoss("{}", shape);
  for (std::size_t r = 0; r < 4; ++r) {
    if (!(*at)[r].is_array() || (*at)[r].size() != 4) return DataLoss("{}", shape);
    for (std::size_t c = 0; c < 4; ++c) {
      if (!(*at)[r][c].is_number()) return DataLoss("{}", shape);
      out->camera_to_world[4 * r + c] = (*at)[r][c].get<double>();
    }
  }
  return {};
}

// As it is written, with slashes, or with the ending that it leaves out: what is there of these.
Path FindFile(const Path& folder, const std::string& name) {
  const Path path = folder / name;
  Path portable = folder / io::PortablePath(name);
  for (const Path& candidate : {path, portable, Path(portable.string() + ".png")}) {
    if (PathExists(candidate)) return candidate;
  }
  return portable;
}

Status ReadFrame(const Json& file, const Json& frame, const Path& folder, TransformsFrame* out) {
  out->pose.fl_x = out->pose.fl_y = 0;
  if (!frame.is_object() || !frame.contains("file_path") || !frame["file_path"].is_string()) {
    return DataLoss("needs \"file_path\", a string");
  }
  out->image = FindFile(folder, frame["file_path"].get<std::string>());
  if (frame.contains("mask_path")) {
    if (!frame["mask_path"].is_string()) return DataLoss("\"mask_path\" must be a string");
    out->mask = FindFile(folder, frame["mask_path"].get<std::string>());
  }
  TILEGRAD_TRY(ReadIntrinsics(file, frame, out));
  return ReadPose(frame, &out->pose);
}

}  // namespace

Result<std::vector<TransformsFrame>> ReadTransforms(const Path& path) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path));
  TILEGRAD_ASSIGN(const Json file, ParseJson(text, path.string()));
  if (!file.is_object() || !file.contains("frames") || !file["frames"].is_array() ||
      file["frames"].empty()) {
    return DataLoss("{}: needs \"frames\", an array of at least one", path.string());
  }
  std::vector<TransformsFrame> frames;
  for (const Json& frame : file["frames"]) {
    TransformsFrame one;
    if (const Status status = ReadFrame(file, frame, path.parent_path(), &one); !status.ok()) {
      return status.Within(fmt::format("{}: frame {}", path.string(), frames.size()));
    }
    frames.push_back(std::move(one));
  }
  return frames;
}

Result<Camera> CameraOfFrame(const TransformsFrame& frame, ImageSize image) {
  const ImageSize own = frame.size.width > 0 && frame.size.height > 0 ? frame.size : image;
  const auto focal = [](double pixels, double angle, double given) {
    if (given > 0) return given;
    return angle > 0 ? 0.5 * pixels / std::tan(0.5 * angle) : 0.0;
  };
  NerfCamera pose = frame.pose;
  pose.fl_x = focal(own.width, frame.angle_x, pose.fl_x);
  pose.fl_y = focal(own.height, frame.angle_y, pose.fl_y);
  if (pose.fl_x == 0) pose.fl_x = focal(std::max(own.width, own.height), frame.angle_long, 0);
  if (pose.fl_y == 0) pose.fl_y = pose.fl_x;
  if (pose.cx == 0) pose.cx = 0.5 * own.width;
  if (pose.cy == 0) pose.cy = 0.5 * own.height;
  auto camera = FromNerf(pose);
  if (!camera.ok()) return camera.status();
  return CameraCast<float>(ResizeCamera(*camera, own, image));
}

std::string WriteTransforms(const std::vector<TransformsView>& views, ImageSize size) {
  nlohmann::ordered_json frames = nlohmann::ordered_json::array();
  for (const TransformsView& view : views) {
    const NerfCamera pose = ToNerf(CameraCast<double>(view.camera));
    nlohmann::ordered_json matrix = nlohmann::ordered_json::array();
    for (std::size_t r = 0; r < 4; ++r) {
      const double* row = &pose.camera_to_world[4 * r];
      matrix.push_back({row[0], row[1], row[2], row[3]});
    }
    nlohmann::ordered_json frame = {{"file_path", view.image}, {"fl_x", pose.fl_x},
                                    {"fl_y", pose.fl_y},       {"cx", pose.cx},
                                    {"cy", pose.cy},           {"transform_matrix", matrix}};
    if (view.gain != 1) frame["exposure_gain"] = view.gain;
    frames.push_back(std::move(frame));
  }
  nlohmann::ordered_json file = {{"w", size.width}, {"h", size.height}, {"frames", frames}};
  return JsonText(std::move(file), 1) + "\n";
}

}  // namespace tilegrad::train

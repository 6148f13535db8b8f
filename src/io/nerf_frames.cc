// SPDX-License-Identifier: Apache-2.0
#include "io/nerf_frames.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "io/json_frame.h"
#include "io/transforms_lens.h"

namespace tilegrad::io {
namespace {

using nlohmann::json;

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

}  // namespace tilegrad::io

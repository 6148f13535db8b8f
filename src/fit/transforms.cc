// SPDX-License-Identifier: Apache-2.0
#include "fit/transforms.h"

#include <algorithm>
#include <cmath>

#include "base/json_text.h"
#include "fit/camera_check.h"

namespace tilegrad::train {
namespace {

// As it is written, with slashes, or with the ending that it leaves out: what is there of these.
Path FindFile(const Path& folder, const std::string& name) {
  const Path path = folder / name;
  Path portable = folder / io::PortablePath(name);
  for (const Path& candidate : {path, portable, Path(portable.string() + ".png")}) {
    if (PathExists(candidate)) return candidate;
  }
  return portable;
}

}  // namespace

Result<std::vector<TransformsFrame>> ReadTransforms(const Path& path) {
  TILEGRAD_ASSIGN(auto frames, io::ReadNerfFrames(path));
  std::vector<TransformsFrame> out;
  for (io::NerfFrame& frame : frames) {
    if (!frame.image) return DataLoss("{}: needs \"file_path\", a string", frame.place);
    TransformsFrame& one = out.emplace_back();
    one.image = FindFile(path.parent_path(), *frame.image);
    if (frame.mask) one.mask = FindFile(path.parent_path(), *frame.mask);
    one.camera = std::move(frame);
  }
  return out;
}

Result<Camera> CameraOfFrame(const TransformsFrame& frame, ImageSize image) {
  const ImageSize own = frame.camera.size.value_or(image);
  io::NerfFrame from = frame.camera;
  if (frame.angle_long > 0)
    from.fl_x = 0.5 * std::max(own.width, own.height) / std::tan(0.5 * frame.angle_long);
  TILEGRAD_ASSIGN(const Camera64 camera, io::CameraOf(from, own));
  const Camera64 resized = ResizeCamera(camera, own, image);
  TILEGRAD_TRY(CheckCamera(resized, image));
  return CameraCast<float>(resized);
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

// SPDX-License-Identifier: Apache-2.0
// Readers of cameras.
#include <cmath>

#include "fuzz/target.h"
#include "io/camera_file.h"

namespace tilegrad::fuzz::camera_targets {

void Check(const Result<std::vector<io::CameraView>>& views) {
  if (!Accepted(views)) return;
  Require(!views->empty(), "at least one camera");
  for (const io::CameraView& view : *views) {
    for (const double x : view.camera.rotation) Require(std::isfinite(x), "a finite rotation");
    for (const double x : view.camera.translation) Require(std::isfinite(x), "a finite place");
    for (const double x : {view.camera.fx, view.camera.fy, view.camera.cx, view.camera.cy}) {
      Require(std::isfinite(x), "a finite lens");
    }
    Require(view.size.width > 0 && view.size.height > 0, "an image has pixels");
  }
}

void Json(Input input) {
  const MemoryFile file(input);
  Check(io::LoadCameras(file.path(), {}));
  Check(io::LoadCameras(file.path(), {{64, 48}, {}}));
}

// The cameras, the images, and points that are not read.
void Colmap(Input input, const char* ending) {
  const auto files = SplitFiles(input);
  PutFile(std::string("colmap/cameras") + ending, files[0]);
  PutFile(std::string("colmap/images") + ending, files.size() > 1 ? files[1] : Input());
  Check(io::LoadColmapCameras(ScratchFolder() / "colmap"));
  std::filesystem::remove_all(ScratchFolder() / "colmap");
}

const Registration kTargets[] = {
    Registration({"cameras", Json}),
    Registration({"colmap_text", [](Input i) { Colmap(i, ".txt"); }}),
    Registration({"colmap_binary", [](Input i) { Colmap(i, ".bin"); }}),
};

}  // namespace tilegrad::fuzz::camera_targets

// SPDX-License-Identifier: Apache-2.0
// Readers of cameras.
#include <cmath>

#include "fuzz/target.h"
#include "io/camera_file.h"

namespace tilegrad::fuzz::camera_targets {

std::vector<io::CameraView> SampleViews() {
  Camera64 camera;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 320;
  camera.cy = 240;
  camera.translation[2] = -3;
  return {{"a.png", camera, {640, 480}}, {"b c.png", camera, {640, 480}}};
}

void Check(const Result<std::vector<io::CameraView>>& views) {
  if (!views.ok()) return Require(!views.status().message().empty(), "an error has a message");
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

std::vector<Bytes> JsonSeeds() {
  const auto views = SampleViews();
  return {Written("a.json", [&](const Path& p) { return io::SaveNerfCameras(p, views); }),
          Written("b.json", [&](const Path& p) { return io::SaveOpenCvCameras(p, views); }),
          ToBytes(R"({"width":64,"height":48,"K":[[50,0,32],[0,50,24],[0,0,1]],"dist":[0,0,0,0,0],)"
                  R"("frames":[{"name":"1","R":[[1,0,0],[0,1,0],[0,0,1]],"t":[0,0,3]},)"
                  R"({"rvec":[0.1,0,0],"tvec":[0,0,3],"K":[[50,0,32],[0,50,24],[0,0,1]]}]})")};
}

// The cameras, the images, and points that are not read.
void Colmap(Input input, const char* ending) {
  const auto files = SplitFiles(input);
  PutFile(std::string("colmap/cameras") + ending, files[0]);
  PutFile(std::string("colmap/images") + ending, files.size() > 1 ? files[1] : Input());
  Check(io::LoadColmapCameras(ScratchFolder() / "colmap"));
  std::filesystem::remove_all(ScratchFolder() / "colmap");
}

std::vector<Bytes> TextSeeds() {
  return {JoinFiles(
      {"# c\n1 PINHOLE 640 480 500 510 320 240\n2 SIMPLE_PINHOLE 64 48 50 32 24\n",
       "# c\n1 1 0 0 0 0.5 1 3 1 a.png\n1 2 3 4 5 -1\n2 0.5 0.5 0.5 0.5 0 0 3 2 b c.png\n\n"})};
}

template <class T>
void Put(const T& value, std::string* out) {
  out->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::vector<Bytes> BinarySeeds() {
  std::string cameras, images;
  Put(std::uint64_t{1}, &cameras);
  Put(std::int32_t{7}, &cameras);
  Put(std::int32_t{1}, &cameras);
  Put(std::uint64_t{640}, &cameras);
  Put(std::uint64_t{480}, &cameras);
  for (const double x : {500.0, 510.0, 320.0, 240.0}) Put(x, &cameras);
  Put(std::uint64_t{1}, &images);
  Put(std::int32_t{1}, &images);
  for (const double x : {1.0, 0.0, 0.0, 0.0, 0.5, 1.0, 3.0}) Put(x, &images);
  Put(std::int32_t{7}, &images);
  images.append("a.png", 6);
  Put(std::uint64_t{1}, &images);
  Put(2.0, &images);
  Put(3.0, &images);
  Put(std::int64_t{-1}, &images);
  return {JoinFiles({cameras, images})};
}

const Registration kTargets[] = {
    Registration({"cameras", Json, JsonSeeds}),
    Registration({"colmap_text", [](Input i) { Colmap(i, ".txt"); }, TextSeeds}),
    Registration({"colmap_binary", [](Input i) { Colmap(i, ".bin"); }, BinarySeeds}),
};

}  // namespace tilegrad::fuzz::camera_targets

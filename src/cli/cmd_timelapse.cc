// SPDX-License-Identifier: Apache-2.0
// tilegrad timelapse: the mesh of a fit, turning while it forms, as an animation.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "base/output_guard.h"
#include "base/whole_number.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "io/mesh_file.h"
#include "io/webp_animation.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "scene/mesh.h"
#include "train/data/dataset.h"

namespace tilegrad::cli {
namespace {

struct TimelapseOptions {
  std::string run, out;
  int size = 320, frames = 72, workers = 0;
  double seconds = 6, turns = 1;
  bool force = false;
};

// The meshes beside the pictures of a fit, by step; at the end the result, with its texture.
Result<std::vector<Path>> MeshFiles(const Path& run) {
  TILEGRAD_TRY(CheckIsRun(run));
  std::vector<Path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(run / "timelapse", error)) {
    if (entry.path().extension() == ".glb") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // steps are padded with zeros
  const Path result = run / "mesh.glb";
  if (!files.empty() && PathExists(result)) files.push_back(result);
  if (!files.empty()) return files;
  return NotFound("{}: no meshes to animate; fits keep one for each picture of --timelapse",
                  (run / "timelapse").string());
}

// All at the place and scale that put the last one into the middle.
Result<std::vector<Mesh>> LoadMeshes(const std::vector<Path>& files) {
  std::vector<Mesh> meshes;
  for (const Path& file : files) {
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(file));
    SetUnlit(loaded.mesh, "fitted");
    meshes.push_back(std::move(loaded.mesh));
  }
  const Bounds bounds = MeshBounds(meshes.back());
  const glm::vec3 centre = (bounds.low + bounds.high) / 2.0f, extent = bounds.high - bounds.low;
  const auto half_extent = static_cast<float>(train::CameraRule().half_extent);
  const float scale = 2 * half_extent / std::max({extent.x, extent.y, extent.z, 1e-30f});
  for (Mesh& mesh : meshes) {
    for (glm::vec3& p : mesh.positions) p = (p - centre) * scale;
  }
  return meshes;
}

// Forming takes the first two thirds of the time; then the last mesh keeps turning.
Result<std::vector<ImageU8>> DrawFrames(const TimelapseOptions& options,
                                        const std::vector<Mesh>& meshes, const Workers& workers) {
  const train::CameraRule rule;
  std::vector<ImageU8> frames;
  ProgressLine line;
  const auto draw = line.Sink();
  for (int i = 0; i < options.frames; ++i) {
    const double time = static_cast<double>(i) / options.frames;
    const auto count = static_cast<double>(meshes.size());
    const auto shown =
        static_cast<std::size_t>(std::min(count - 1, std::floor(1.5 * time * count)));
    const Camera camera =
        OrbitCamera(rule.lens, 60 - 360 * options.turns * time, rule.elevation, rule.distance);
    TILEGRAD_ASSIGN(auto picture, DrawMesh(meshes[shown],
                                           {{&camera, 1}, rule.lens.width, options.size}, workers));
    frames.push_back(std::move(picture[0]));
    if (StopOnSignals()) return Cancelled("stopped; nothing was written");
    draw({"drawing", static_cast<std::uint64_t>(i + 1), static_cast<std::uint64_t>(options.frames),
          ""});
  }
  return frames;
}

Status RunTimelapse(const TimelapseOptions& options) {
  const Path run = options.run;
  const Path out = options.out.empty() ? run / "timelapse.webp" : Path(options.out);
  // The run's own is replaced.
  const OutputGuard guard(options.force || options.out.empty());
  TILEGRAD_TRY(guard.Check(out));
  TILEGRAD_ASSIGN(const auto files, MeshFiles(run));
  TILEGRAD_ASSIGN(const auto meshes, LoadMeshes(files));
  const Workers workers(options.workers);
  TILEGRAD_ASSIGN(const auto frames, DrawFrames(options, meshes, workers));
  const int frame_ms =
      std::clamp(WholeNumber<int>(1000 * options.seconds / options.frames), 1, 65535);
  TILEGRAD_TRY(WriteGuarded(guard, out, [&] {
    return io::SaveWebpAnimation(out, frames, {.frame_ms = frame_ms, .quality = 80});
  }));
  Print("{}: {} of {}\n", out.string(), Count(frames.size(), "frame"),
        Count(meshes.size(), "mesh state"));
  PrintResult({{"animation", out.string()}, {"frames", frames.size()}, {"meshes", meshes.size()}});
  return {};
}

}  // namespace

void AddTimelapse(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "timelapse", "Animate a fit as a WebP: the mesh turns while it forms", RunTimelapse);
  command->Add("run", &options->run, "folder of a fit", {Required{}});
  command->Add("--out", &options->out, "output file [RUN/timelapse.webp]", {EndsIn(".webp")});
  command->Add("--size", &options->size, "width and height, pixels", {Range{16, 2048}});
  command->Add("--frames", &options->frames, "number of frames", {Range{2, 2000}});
  command->Add("--seconds", &options->seconds, "duration, seconds", {AboveZero()});
  command->Add("--turns", &options->turns, "turns about the object over the animation");
  AddForceOption(command, &options->force);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli

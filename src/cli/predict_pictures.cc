// SPDX-License-Identifier: Apache-2.0
#include "cli/predict_pictures.h"

#include "base/error.h"
#include "io/image_file.h"
#include "io/webp_animation.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "train/data/dataset.h"

namespace tilegrad::cli {
namespace {

constexpr int kTurntableViews = 8, kTurntableColumns = 4, kTurntableFrames = 36,
              kTurntableSize = 256;
constexpr int kTurntableFrameMilliseconds = 100, kTurntableQuality = 85;

Result<std::vector<ImageU8>> DrawAround(const Mesh& mesh, int views, const Workers& workers) {
  const train::CameraRule rule;
  std::vector<Camera> cameras;
  for (int i = 0; i < views; ++i)
    cameras.push_back(OrbitCamera(rule.lens, -360.0 * i / views, rule.elevation, rule.distance));
  return DrawMesh(mesh, {cameras, rule.lens.width, kTurntableSize}, workers);
}

}  // namespace

Status DrawTurntable(const Mesh& mesh, const Path& file, const Workers& workers) {
  TILEGRAD_ASSIGN(const auto views, DrawAround(mesh, kTurntableViews, workers));
  return io::SavePng(file, TileImages(views, kTurntableColumns));
}

Status AnimateTurntable(const Mesh& mesh, const Path& file, const Workers& workers,
                        const Watch& watch) {
  TILEGRAD_ASSIGN(const auto frames, DrawAround(mesh, kTurntableFrames, workers));
  return io::SaveWebpAnimation(
      file, frames,
      {.frame_ms = kTurntableFrameMilliseconds, .quality = kTurntableQuality, .watch = watch});
}

Status DrawMatch(std::span<const std::uint8_t> picture, const Mesh& prediction,
                 const train::RefinedMesh& refined, const Path& file, const Workers& workers) {
  constexpr int size = train::kRefineSize;
  const PlanarRgba<std::uint8_t> planes{picture.first(3 * size * size),
                                        picture.subspan(3 * size * size), size, size};
  std::vector<ImageU8> cells = {Enlarged(OverGrey(planes, kPaper), kTurntableSize / size)};
  for (const auto& [mesh, camera] : {std::pair(&prediction, &refined.camera_before),
                                     std::pair(&refined.mesh, &refined.camera)}) {
    TILEGRAD_ASSIGN(auto views, DrawMesh(*mesh, {{camera, 1}, size, kTurntableSize}, workers));
    cells.push_back(std::move(views[0]));
  }
  return io::SavePng(file, TileImages(cells, static_cast<int>(cells.size())));
}

}  // namespace tilegrad::cli

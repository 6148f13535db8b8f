// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/sheet.h"

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "train/data/dataset.h"

namespace tilegrad::train {
namespace {

constexpr double kFront = 50, kBehind = 230, kElevation = 20;  // degrees
constexpr double kNearer = 0.8;                                // than cameras of datasets

}  // namespace

Camera SheetCamera(int size, double azimuth) {
  const CameraRule rule;
  Lens lens = rule.lens;
  lens.width = lens.height = size;
  return OrbitCamera(lens, kFront + azimuth, kElevation, kNearer * rule.distance);
}

Result<std::vector<ImageU8>> DrawObjects(std::span<const Mesh> meshes, const Camera& camera,
                                         int size, const Workers& workers) {
  std::vector<LitRenderer> renderers(static_cast<std::size_t>(workers.count()));
  std::vector<ImageU8> out(meshes.size());
  std::vector<Status> failures(meshes.size());
  workers.For(meshes.size(), [&](std::size_t i, std::size_t worker) {
    const auto planes = renderers[worker].Render(meshes[i], {&camera, 1}, size);
    failures[i] = planes.status();
    if (!planes.ok()) return;
    const std::span<const std::uint8_t> all = *planes;
    const std::size_t rgb = all.size() / 4 * 3;
    out[i] =
        OverGrey(PlanarRgba<std::uint8_t>{all.first(rgb), all.subspan(rgb), size, size}, kPaper);
  });
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return out;
}

Result<ImageU8> DrawSheet(std::span<const Mesh> meshes, const SheetLook& look,
                          const Workers& workers) {
  TILEGRAD_ASSIGN(auto front, DrawObjects(meshes, SheetCamera(look.size, 0), look.size, workers));
  if (!look.behind) return TileImages(front, look.columns, 2);
  TILEGRAD_ASSIGN(auto behind, DrawObjects(meshes, SheetCamera(look.size, kBehind - kFront),
                                           look.size, workers));
  std::vector<ImageU8> cells;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    cells.push_back(std::move(front[i]));
    cells.push_back(std::move(behind[i]));
  }
  return TileImages(cells, look.columns, 2);
}

}  // namespace tilegrad::train

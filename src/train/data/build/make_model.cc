// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/make_model.h"

#include <algorithm>

#include "base/error.h"
#include "train/data/build/truth_mesh.h"
#include "train/data/split.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

// Counts up when the rules change: light, supersampling, glass, clustering, voxels, families.
constexpr int kRulesVersion = 3;
constexpr float kGlassAlpha = 0.2f;  // materials with less are glass

Result<MadeModel> FromMesh(const SourceEntry& entry, Mesh mesh, const DatasetInfo& info,
                           LitRenderer& renderer) {
  MadeModel made;
  made.stamp.source_faces = static_cast<int>(mesh.faces.size());
  TILEGRAD_TRY(PrepareMesh(info, &mesh));
  made.stamp.geometry = GeometryFingerprint(mesh);
  std::vector<Camera> cameras;
  for (int i = 0; i < info.views; ++i) cameras.push_back(info.camera.View(i));
  TILEGRAD_ASSIGN(made.data.images, renderer.Render(mesh, cameras, info.image_size));
  TILEGRAD_ASSIGN(made.data.occupancy, Voxelize(mesh, kOccupancyResolution));
  const std::uint64_t seed = HashText(entry.class_name + "/" + entry.id, 0);
  TILEGRAD_ASSIGN(made.data.points, SampleSurface(mesh, kTruthPoints, seed));
  made.data.mesh = MakeTruthMesh(mesh, kTruthFaces);
  return made;
}

// A model that cannot be seen from anywhere teaches nothing and divides by zero in an IoU.
Status CheckVisible(const ModelData& data, int size) {
  const auto pixels = static_cast<std::size_t>(size) * size;
  for (std::size_t alpha = 3 * pixels; alpha < data.images.size(); alpha += 4 * pixels) {
    const auto begin = data.images.begin() + static_cast<std::ptrdiff_t>(alpha);
    if (std::any_of(begin, begin + static_cast<std::ptrdiff_t>(pixels),
                    [](std::uint8_t a) { return a >= 128; })) {
      return {};
    }
  }
  return InvalidArgument("no view shows more than half a pixel of it");
}

}  // namespace

void RemoveGlass(Mesh* mesh) {
  if (mesh->materials.empty()) return;
  std::vector<char> keep(mesh->faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    const auto m =
        mesh->face_materials.empty() ? 0 : static_cast<std::size_t>(mesh->face_materials[f]);
    keep[f] = mesh->materials[m].base_color.a >= kGlassAlpha;
  }
  KeepFaces(keep, mesh);
}

Status PrepareMesh(const DatasetInfo& info, Mesh* mesh) {
  TILEGRAD_TRY(Validate(*mesh));
  RemoveGlass(mesh);
  TurnUpright(info.up, mesh);
  return NormalizeToBox(*mesh, static_cast<float>(info.camera.half_extent));
}

Result<MadeModel> MakeModel(const SourceEntry& entry, SourceModel model, const DatasetInfo& info,
                            LitRenderer& renderer) {
  MadeModel made;
  if (auto* data = std::get_if<ModelData>(&model.data)) {
    made.data = std::move(*data);
  } else {
    TILEGRAD_ASSIGN(made, FromMesh(entry, std::move(std::get<Mesh>(model.data)), info, renderer));
  }
  TILEGRAD_TRY(CheckVisible(made.data, info.image_size));
  made.stamp.recipe = info.recipe;
  made.stamp.inputs = std::move(model.inputs);
  return made;
}

std::string RecipeOf(const DatasetInfo& info, std::uint64_t version) {
  const CameraRule& camera = info.camera;
  const std::string text = fmt::format(
      "rules {} source {} credits {} size {} views {} fov {} azimuth {} elevation {} distance {} "
      "half {}{}{}",
      kRulesVersion, info.source, fmt::join(info.credits, ";"), info.image_size, info.views,
      camera.lens.fov_y, camera.azimuth_step, camera.elevation, camera.distance, camera.half_extent,
      info.up == UpAxis::kZ   ? " up z"
      : info.up == UpAxis::kX ? " up x"
                              : "",
      version == 0 ? "" : fmt::format(" list {:016x}", version));
  return fmt::format("{:016x}", HashText(text, 0));
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// The paper's own renders, as its code reads them (github.com/nv-tlabs/DIB-R):
//
//   SYNSET/MODEL/0.png ... 23.png        RGBA
//   SYNSET/MODEL/0.npy ... 23.npy        [4,4]: [R t; 0 1], world to camera, OpenGL's axes
//   SYNSET/MODEL/model-0.45.binvox       32^3, by binvox -cb -dc -aw
//   SYNSET/MODEL/model-0.45.obj          may be missing: then there is no F-score
//
// Objects are centred, their largest half-extent is 0.45; the vertical field of view is that of
// Blender's lens.

#include "base/error.h"
#include "io/binvox.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "train/data/build/truth_mesh.h"
#include "train/data/sources/rendered_views.h"
#include "train/data/sources/split_list.h"
#include "train/data/split.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

Result<Camera64> ReadDibrCamera(const Path& file) {
  TILEGRAD_ASSIGN(const io::NpyArray array, io::LoadNpy(file));
  TILEGRAD_ASSIGN(const std::vector<double> m, NumbersOf(array, file.string()));
  if (array.shape != std::vector<std::size_t>{4, 4})
    return DataLoss("{}: expected a matrix [4,4]", file.string());
  Camera64 camera = OrbitCamera<double>(Lens{.width = 1, .height = 1}, 0, 0, 1);
  for (std::size_t row = 0; row < 3; ++row) {
    std::copy_n(&m[4 * row], 3, camera.rotation + 3 * row);
    camera.translation[row] = m[4 * row + 3];
  }
  return camera;
}

Status ReadDibrMesh(const Path& file, ModelData* truth) {
  TILEGRAD_ASSIGN(const io::LoadedMesh loaded, io::LoadMesh(file));
  const std::uint64_t seed = HashText(file.parent_path().filename().string(), 0);
  TILEGRAD_ASSIGN(truth->points, SampleSurface(loaded.mesh, kTruthPoints, seed));
  truth->mesh = MakeTruthMesh(loaded.mesh, kTruthFaces);
  return {};
}

Status ReadDibrTruth(const Path& folder, ModelData* truth) {
  const Path voxels = folder / "model-0.45.binvox", mesh = folder / "model-0.45.obj";
  TILEGRAD_ASSIGN(io::BinvoxGrid grid, io::LoadBinvox(voxels));
  if (grid.side != kOccupancyResolution)
    return DataLoss("{}: {}^3 voxels, expected {}^3", voxels.string(), grid.side,
                    kOccupancyResolution);
  truth->occupancy = std::move(grid.voxels);
  return PathExists(mesh) ? ReadDibrMesh(mesh, truth) : Status();
}

Result<RenderedModel> ReadDibrModel(const Path& folder) {
  RenderedModel model;
  for (int v = 0; v < kRenderedViews; ++v) {
    TILEGRAD_ASSIGN(const Camera64 camera, ReadDibrCamera(folder / fmt::format("{}.npy", v)));
    model.views.push_back({folder / fmt::format("{}.png", v), {}, camera});
  }
  TILEGRAD_TRY(ReadDibrTruth(folder, &model.truth));
  return model;
}

}  // namespace

Result<std::unique_ptr<ModelSource>> DibrSource(const Path& folder, const SplitList& list,
                                                int image_size) {
  RenderedSet set;
  set.name = "dibr";
  set.credit = "Renders of ShapeNetCore models by Chen et al. (DIB-R, 2019).";
  set.expected = "SYNSET/MODEL/0.png, 0.npy and model-0.45.binvox";
  set.models = folder;
  set.read = ReadDibrModel;
  return OpenRenderedSet(std::move(set), list, image_size);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Renders and voxels of 3D-R2N2 (Choy et al. 2016):
//
//   ShapeNetRendering/SYNSET/MODEL/rendering/00.png ... 23.png         137 x 137, RGBA
//   ShapeNetRendering/SYNSET/MODEL/rendering/rendering_metadata.txt    a line a view
//   ShapeNetVox32/SYNSET/MODEL/model.binvox                            32^3
//
// A line is azimuth, elevation, in-plane rotation (degrees), distance and field of view. Blender's
// camera stands at 1.75 times that distance, at our orbit's angles, in the model's coordinates (y
// up). It kept its lens of 35 mm before 32 mm of film, 49.13 degrees; the last column, always 25,
// was never used. The in-plane rotation is about the axis that leads from the object to the camera.
#include <cmath>
#include <sstream>

#include "base/error.h"
#include "io/binvox.h"
#include "train/data/sources/rendered_views.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::train {
namespace {

constexpr double kChoyDistance = 1.75;     // of a column of 1
constexpr double kChoyTrainPortion = 0.8;  // 3D-R2N2's DATASET_PORTION
constexpr int kChoySide = kOccupancyResolution;

// The camera turned by `degrees` about its z axis, clockwise as seen from behind it.
Camera64 RolledCamera(const Camera64& camera, double degrees) {
  const double angle = degrees * std::acos(-1.0) / 180, c = std::cos(angle), s = std::sin(angle);
  Camera64 out = camera;
  for (int k = 0; k < 3; ++k) {
    out.rotation[k] = c * camera.rotation[k] - s * camera.rotation[3 + k];
    out.rotation[3 + k] = s * camera.rotation[k] + c * camera.rotation[3 + k];
  }
  out.translation[0] = c * camera.translation[0] - s * camera.translation[1];
  out.translation[1] = s * camera.translation[0] + c * camera.translation[1];
  return out;
}

Result<std::vector<Camera64>> ReadChoyCameras(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::istringstream lines(text);
  std::vector<Camera64> cameras;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream numbers(line);
    double azimuth = 0, elevation = 0, in_plane = 0, distance = 0, fov = 0;
    if (!(numbers >> azimuth)) continue;
    numbers >> elevation >> in_plane >> distance >> fov;
    const auto camera = MakeCamera<double>(Lens{.width = 1, .height = 1},
                                           {azimuth, elevation, kChoyDistance * distance});
    if (numbers.fail() || !camera.ok() || !std::isfinite(in_plane))
      return DataLoss("{}: line {}: expected five numbers of a camera, got \"{}\"", file.string(),
                      cameras.size() + 1, line);
    cameras.push_back(RolledCamera(*camera, in_plane));
  }
  if (cameras.size() == kRenderedViews) return cameras;
  return DataLoss("{}: {} views, expected {}", file.string(), cameras.size(), kRenderedViews);
}

// The object in the middle of the cube, as binvox -cb puts it, and where its centre is in the
// model's coordinates. Without -cb it stands in the cube's lowest corner.
struct CentredVoxels {
  std::vector<std::uint8_t> occupancy =
      std::vector<std::uint8_t>(std::size_t{kChoySide} * kChoySide * kChoySide);
  double centre[3];
};

// Calls at(index, voxel) for each solid voxel.
template <class At>
void ForEachSolid(const io::BinvoxGrid& grid, const At& at) {
  for (std::size_t i = 0; i < grid.voxels.size(); ++i) {
    const int n = static_cast<int>(i);
    if (grid.voxels[i] != 0)
      at(std::array{n / (kChoySide * kChoySide), n / kChoySide % kChoySide, n % kChoySide});
  }
}

CentredVoxels CentreVoxels(const io::BinvoxGrid& grid) {
  std::array<int, 3> low = {kChoySide, kChoySide, kChoySide}, high = {-1, -1, -1}, shift{};
  ForEachSolid(grid, [&](const std::array<int, 3>& at) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
  });
  CentredVoxels out;
  for (std::size_t k = 0; k < 3; ++k) {
    const int off = low[k] + high[k] + 1 - kChoySide;  // of the box's middle, in half voxels
    if (std::abs(off) > 2) shift[k] = -off / 2;
    out.centre[k] = grid.translate[k] + grid.scale * (0.5 - shift[k] / double{kChoySide});
  }
  ForEachSolid(grid, [&](const std::array<int, 3>& at) {
    const int x = at[0] + shift[0], y = at[1] + shift[1], z = at[2] + shift[2];
    out.occupancy[static_cast<std::size_t>((x * kChoySide + y) * kChoySide + z)] = 1;
  });
  return out;
}

Result<RenderedModel> ReadChoyModel(const Path& voxels, const Path& folder, double half_extent) {
  const Path rendering = folder / "rendering";
  TILEGRAD_ASSIGN(const auto cameras, ReadChoyCameras(rendering / "rendering_metadata.txt"));
  const Path file = voxels / folder.parent_path().filename() / folder.filename() / "model.binvox";
  TILEGRAD_ASSIGN(const io::BinvoxGrid grid, io::LoadBinvox(file));
  if (grid.side != kChoySide)
    return DataLoss("{}: {}^3 voxels, expected {}^3", file.string(), grid.side, kChoySide);
  CentredVoxels centred = CentreVoxels(grid);
  RenderedModel model;
  model.truth.occupancy = std::move(centred.occupancy);
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    // The cube's side is the model's longest.
    model.views.push_back(
        {rendering / fmt::format("{:02}.png", v),
         {},
         CameraOfObject(cameras[v], centred.centre, grid.scale / (2 * half_extent))});
  }
  return model;
}

}  // namespace

Result<std::unique_ptr<ModelSource>> ChoySource(const Path& folder, const SplitList& list,
                                                int image_size) {
  RenderedSet set;
  set.name = "choy";
  set.credit = "Renders and voxels of ShapeNetCore models by Choy et al. (3D-R2N2, 2016).";
  set.expected = "ShapeNetRendering/SYNSET/MODEL/rendering and ShapeNetVox32/SYNSET/MODEL";
  set.models = folder / "ShapeNetRendering";
  set.train_portion = kChoyTrainPortion;
  set.read = [voxels = folder / "ShapeNetVox32", half = set.like.half_extent](const Path& model) {
    return ReadChoyModel(voxels, model, half);
  };
  return OpenRenderedSet(std::move(set), list, image_size);
}

}  // namespace tilegrad::train

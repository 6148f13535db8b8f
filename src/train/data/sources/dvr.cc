// SPDX-License-Identifier: Apache-2.0
// N3MR's renders as Niemeyer et al. (Differentiable Volumetric Rendering, 2020) keep them:
//
//   SYNSET/softras_train.lst, softras_val.lst, softras_test.lst    a model a line; or train.lst,
//   ... SYNSET/MODEL/image/0000.png ... 0023.png                       64 x 64, RGB over white
//   SYNSET/MODEL/mask/0000.png ...                                 not 0 inside
//   SYNSET/MODEL/cameras.npz                                       world_mat_0, camera_mat_0, ...
//   SYNSET/MODEL/pointcloud.npz                                    points [100000,3]
//
// p = camera_mat world_mat scale_mat p_object, with OpenCV's axes; p.xy / p.z is in [-1, 1] from
// the upper left corner of the picture to its lower right. The object's longest side is that of the
// unit cube around the origin, y up. scale_mat may be missing.
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/npz.h"
#include "scene/camera_conventions.h"
#include "train/data/sources/rendered_views.h"
#include "train/data/sources/split_list.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

constexpr double kDvrHalfExtent = 0.5;
constexpr double kFarthestPoint = 1;  // that a point of an object of this size may be

// `name` of the file as a 4 x 4 matrix; a file of three rows gets the last.
Result<Mat4Array> DvrMatrix(const io::NpzArrays& arrays, const std::string& name) {
  const auto at = arrays.find(name);
  if (at == arrays.end()) return DataLoss("no array \"{}\"", name);
  TILEGRAD_ASSIGN(const std::vector<double> numbers, NumbersOf(at->second, name));
  if (numbers.size() != 12 && numbers.size() != 16)
    return DataLoss("array \"{}\" is no 3 x 4 or 4 x 4 matrix", name);
  Mat4Array out = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::copy(numbers.begin(), numbers.end(), out.begin());
  return out;
}

Mat4Array MatrixProduct(const Mat4Array& a, const Mat4Array& b) {
  Mat4Array out{};
  for (std::size_t i = 0; i < 16; ++i) {
    for (std::size_t k = 0; k < 4; ++k) out[i] += a[i / 4 * 4 + k] * b[4 * k + i % 4];
  }
  return out;
}

double Determinant3(const Mat4Array& m) {
  return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
         m[2] * (m[4] * m[9] - m[5] * m[8]);
}

Result<Camera64> DvrCamera(const io::NpzArrays& arrays, int view) {
  TILEGRAD_ASSIGN(const Mat4Array k, DvrMatrix(arrays, fmt::format("camera_mat_{}", view)));
  TILEGRAD_ASSIGN(Mat4Array world, DvrMatrix(arrays, fmt::format("world_mat_{}", view)));
  const std::string scale_name = fmt::format("scale_mat_{}", view);
  if (arrays.contains(scale_name)) {
    TILEGRAD_ASSIGN(const Mat4Array scale, DvrMatrix(arrays, scale_name));
    world = MatrixProduct(world, scale);
  }
  const double scale = std::cbrt(Determinant3(world));  // depth counts in units of the object
  OpenCvCamera out;
  out.centre = PixelCentre::kHalf;
  out.k = {0.5 * k[0], 0.5 * k[1], 0.5 * (k[2] + 1), 0, 0.5 * k[5], 0.5 * (k[6] + 1), 0, 0, 1};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) out.rotation[3 * row + c] = world[4 * row + c] / scale;
    out.translation[row] = world[4 * row + 3] / scale;
  }
  return FromOpenCv(out);
}

Status ReadDvrPoints(const Path& file, ModelData* truth) {
  TILEGRAD_ASSIGN(const io::NpyArray array, io::LoadNpzArray(file, "points"));
  TILEGRAD_ASSIGN(const std::vector<double> numbers, NumbersOf(array, "points"));
  if (array.shape.size() != 2 || array.shape[1] != 3 || numbers.empty())
    return DataLoss("{}: \"points\" must be [N,3]", file.string());
  if (!std::ranges::all_of(numbers, [](double x) { return std::abs(x) <= kFarthestPoint; }))
    return DataLoss("{}: a point that is not within {:g} of the origin", file.string(),
                    kFarthestPoint);
  std::vector<glm::vec3> all;
  for (std::size_t i = 0; i < numbers.size(); i += 3)
    all.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  TILEGRAD_ASSIGN(truth->occupancy, VoxelizePoints(all, kDvrHalfExtent, kOccupancyResolution));
  // Each is an independent draw, so any of them are as good as the first.
  const auto scale = static_cast<float>(CameraRule{}.half_extent / kDvrHalfExtent);
  const std::size_t count = std::min<std::size_t>(all.size(), kTruthPoints);
  for (std::size_t i = 0; i < count; ++i)
    truth->points.push_back(scale * all[i * all.size() / count]);
  return {};
}

Result<RenderedModel> ReadDvrModel(const Path& folder) {
  const Path cameras = folder / "cameras.npz";
  TILEGRAD_ASSIGN(const io::NpzArrays arrays, io::LoadNpz(cameras));
  RenderedModel model;
  for (int v = 0; v < kRenderedViews; ++v) {
    const auto camera = DvrCamera(arrays, v);
    if (!camera.ok()) return camera.status().Within(cameras.string());
    const std::string name = fmt::format("{:04}.png", v);
    model.views.push_back({folder / "image" / name, folder / "mask" / name, *camera});
  }
  TILEGRAD_TRY(ReadDvrPoints(folder / "pointcloud.npz", &model.truth));
  return model;
}

// The lists in the classes' folders; SoftRas' where there are both.
Result<std::vector<Path>> FindDvrLists(const Path& folder) {
  TILEGRAD_ASSIGN(const auto synsets, ListFolder(folder));
  std::vector<Path> lists;
  for (const Path& synset : synsets) {
    for (const char* split : {"train", "val", "test"}) {
      for (const char* prefix : {"softras_", ""}) {
        const Path list = synset / (std::string(prefix) + split + ".lst");
        if (!IsFile(list)) continue;
        lists.push_back(list);
        break;
      }
    }
  }
  return lists;
}

}  // namespace

Result<std::unique_ptr<ModelSource>> DvrSource(const Path& folder, const SplitList& list,
                                               int image_size) {
  RenderedSet set;
  set.name = "dvr";
  set.credit =
      "Renders of ShapeNetCore models by Kato et al. (Neural 3D Mesh Renderer, 2018), as "
      "kept by Niemeyer et al. (Differentiable Volumetric Rendering, 2020).";
  set.expected = "SYNSET/MODEL/image, mask, cameras.npz and pointcloud.npz";
  set.models = folder;
  set.like = NmrCameras();
  set.read = ReadDvrModel;
  if (!list.empty()) return OpenRenderedSet(std::move(set), list, image_size);
  TILEGRAD_ASSIGN(const std::vector<Path> files, FindDvrLists(folder));
  TILEGRAD_ASSIGN(const SplitList own, SplitList::Read(files));
  return OpenRenderedSet(std::move(set), own, image_size);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "io/mat_file.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {
namespace {

using io::MatArray;

MatArray RowArray(std::initializer_list<double> values) {
  return MatArray::Numbers({values.size(), 1}, std::vector<double>(values));
}

MatArray BoxOf(const PhotoBox& box) {
  return MatArray::Structs({"x1", "y1", "x2", "y2"},
                           {MatArray::Number(box.left + 1), MatArray::Number(box.top + 1),
                            MatArray::Number(box.right), MatArray::Number(box.bottom)});
}

MatArray PartsOf(const std::vector<Keypoint>& keypoints) {
  std::vector<double> numbers;
  for (const Keypoint& k : keypoints) {
    numbers.push_back(k.visible ? k.x + 0.5 : 0);
    numbers.push_back(k.visible ? k.y + 0.5 : 0);
    numbers.push_back(k.visible ? 1 : 0);
  }
  return MatArray::Numbers({3, keypoints.size()}, numbers);
}

// Columns one after the other.
MatArray MaskOf(const PhotoMask& mask) {
  std::vector<std::uint8_t> values;
  for (int x = 0; x < mask.width; ++x)
    for (int y = 0; y < mask.height; ++y) values.push_back(mask.at(x, y) ? 1 : 0);
  return MatArray::Mask(static_cast<std::size_t>(mask.height), static_cast<std::size_t>(mask.width),
                        values);
}

MatArray RotationArray(const WeakPerspective& camera) {
  const Mat3Array r = RotationOf(camera.quaternion);
  std::vector<double> columns;
  for (std::size_t i = 0; i < 9; ++i) columns.push_back(r[3 * (i % 3) + i / 3]);
  return MatArray::Numbers({3, 3}, columns);
}

MatArray PlacesArray(const std::vector<std::array<double, 3>>& points) {
  std::vector<double> numbers;
  for (const auto& point : points) numbers.insert(numbers.end(), point.begin(), point.end());
  return MatArray::Numbers({3, points.size()}, numbers);
}

struct Part {
  std::vector<MatArray> images, cameras;
  std::vector<std::string> camera_fields = {"rot", "scale", "trans"};

  void Add(const Photograph& photo) {
    images.push_back(MatArray::Text(photo.id));
    images.push_back(BoxOf(photo.box));
    images.push_back(MatArray::Number(photo.mask.width));
    images.push_back(MatArray::Number(photo.mask.height));
    images.push_back(PartsOf(photo.keypoints));
    images.push_back(MaskOf(photo.mask));
    cameras.push_back(RotationArray(*photo.camera));
    cameras.push_back(MatArray::Number(photo.camera->scale));
    cameras.push_back(
        RowArray({photo.camera->translation[0] + 0.5, photo.camera->translation[1] + 0.5}));
    if (camera_fields.size() > 3) cameras.push_back(PlacesArray(photo.points));
  }
};

Status WriteKeypointNames(const Path& folder, const PhotographSet& set) {
  std::vector<double> mirror;
  for (const int m : set.mirror) mirror.push_back(m + 1);
  MatArray names;
  names.kind = io::MatKind::kCell;
  names.dims = {1, set.keypoint_names.size()};
  for (const std::string& name : set.keypoint_names) names.elements.push_back(MatArray::Text(name));
  return io::SaveMat(
      folder / "data" / (set.class_name + "_kps.mat"),
      {{"kp_names", names}, {"kp_perm_inds", MatArray::Numbers({mirror.size(), 1}, mirror)}});
}

}  // namespace

Status WriteCmrLayout(const Path& folder, const PhotographSet& set) {
  const bool cub = set.source == "cub";
  if (!cub) TILEGRAD_TRY(WriteKeypointNames(folder, set));
  for (const Split split : {Split::kTrain, Split::kValidation, Split::kTest}) {
    Part part;
    const std::vector<int> chosen = set.Select(split);
    const auto photo = [&](int i) -> const Photograph& {
      return set.photographs[static_cast<std::size_t>(i)];
    };
    // Of all photographs of a part, or of none.
    if (std::ranges::any_of(chosen, [&](int i) { return !photo(i).points.empty(); }))
      part.camera_fields.emplace_back("points");
    for (const int i : chosen) part.Add(photo(i));
    // PASCAL3D+ calls its held-out part "val" and has no other.
    const std::string name = split == Split::kTrain         ? "train"
                             : split == Split::kTest && cub ? "test"
                                                            : "val";
    if (part.images.empty()) continue;
    const std::string anno = cub ? name + "_cub_cleaned.mat" : set.class_name + "_" + name + ".mat";
    const std::string sfm = (cub ? "anno" : set.class_name) + "_" + name + ".mat";
    TILEGRAD_TRY(io::SaveMat(
        folder / "data" / anno,
        {{"images", MatArray::Structs({"rel_path", "bbox", "width", "height", "parts", "mask"},
                                      std::move(part.images))}}));
    TILEGRAD_TRY(
        io::SaveMat(folder / "sfm" / sfm,
                    {{"sfm_anno", MatArray::Structs(part.camera_fields, std::move(part.cameras))},
                     {"S", PlacesArray(set.mean_keypoints)}}));
  }
  return {};
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/file.h"
#include "train/data/dataset_files.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {
namespace {

// Limits beyond which an annotation is an error: a crop would take hours, or a loss would not be
// finite.
constexpr double kFarthestPlace = 1 << 20;                    // pixels
constexpr double kSmallestScale = 1e-6, kLargestScale = 1e6;  // pixels for a unit of the world

bool IsFarther(double at, double most) { return !(std::abs(at) <= most); }

Status CheckBox(const Photograph& photo) {
  const PhotoBox& box = photo.box;
  const double width = photo.mask.width, height = photo.mask.height;
  const double beyond = std::max(width, height);
  if (box.left >= -beyond && box.top >= -beyond && box.right <= width + beyond &&
      box.bottom <= height + beyond)
    return {};
  return InvalidArgument("its box ({}, {}) to ({}, {}) lies outside of its {} x {} pixels",
                         box.left, box.top, box.right, box.bottom, width, height);
}

Status CheckKeypoints(const Photograph& photo) {
  for (std::size_t k = 0; k < photo.keypoints.size(); ++k) {
    const Keypoint& keypoint = photo.keypoints[k];
    if (!keypoint.visible) continue;
    if (IsFarther(keypoint.x, kFarthestPlace) || IsFarther(keypoint.y, kFarthestPlace))
      return InvalidArgument("its keypoint {} at ({}, {}) is more than {} pixels away", k + 1,
                             keypoint.x, keypoint.y, kFarthestPlace);
  }
  return {};
}

Status CheckCamera(const WeakPerspective& camera) {
  if (!(camera.scale >= kSmallestScale && camera.scale <= kLargestScale))
    return InvalidArgument("its camera's scale is {}; must be {:g} to {:g} pixels per unit",
                           camera.scale, kSmallestScale, kLargestScale);
  for (const double t : camera.translation) {
    if (IsFarther(t, kFarthestPlace))
      return InvalidArgument("its camera's translation of {} is more than {} pixels", t,
                             kFarthestPlace);
  }
  return {};
}

// `what`: "a mean keypoint".
Status CheckWorld(const std::vector<std::array<double, 3>>& places, const char* what) {
  for (const auto& place : places) {
    for (const double x : place) {
      if (IsFarther(x, kLargestScale))
        return InvalidArgument("{} is at {}; must be within {:g} of the middle", what, x,
                               kLargestScale);
    }
  }
  return {};
}

}  // namespace

Status CheckPhotograph(const Photograph& photo) {
  TILEGRAD_TRY(CheckBox(photo));
  TILEGRAD_TRY(CheckKeypoints(photo));
  TILEGRAD_TRY(CheckWorld(photo.points, "the true place of a keypoint"));
  return photo.camera ? CheckCamera(*photo.camera) : Status();
}

double PhotoBox::longer_side() const { return std::max(right - left, bottom - top); }

std::vector<int> PhotographSet::Select(Split split) const {
  std::vector<int> out;
  for (std::size_t i = 0; i < photographs.size(); ++i) {
    if (photographs[i].split == split) out.push_back(static_cast<int>(i));
  }
  return out;
}

Result<PhotographSet> OpenPhotographs(const Path& folder) {
  if (!IsFolder(folder)) return NotFound("{}: no such folder", folder.string());
  if (PathExists(DatasetInfoPath(folder)))
    return InvalidArgument("{}: holds a dataset of models; this network learns from photographs",
                           folder.string());
  TILEGRAD_ASSIGN(std::optional<PhotographSet> set, OpenCmrLayout(folder));
  if (!set) {
    TILEGRAD_ASSIGN(set, OpenPhotoFolder(folder));
  }
  if (!set)
    return NotFound(
        "{}: neither CUB-200 nor PASCAL3D+ as CMR lays them out (there is no "
        "data/train_cub_cleaned.mat or data/car_kps.mat), nor a folder of pictures",
        folder.string());
  if (set->Select(Split::kTrain).empty())
    return InvalidArgument("{}: no photographs to train on", folder.string());
  for (const Photograph& photo : set->photographs)
    TILEGRAD_TRY(CheckPhotograph(photo).Within((folder / photo.id).string()));
  TILEGRAD_TRY(CheckWorld(set->mean_keypoints, "a mean keypoint").Within(folder.string()));
  return std::move(*set);
}

}  // namespace tilegrad::train

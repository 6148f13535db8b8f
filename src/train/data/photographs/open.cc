// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "base/file.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

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
  return std::move(*set);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Annotations in CMR's layout of CUB-200 and PASCAL3D+, which OpenCmrLayout reads.
#pragma once

#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// Writes <folder>/data and <folder>/sfm; `set`: source "cub" (fifteen keypoints) or "pascal3d" with
// its class, with a mask and a camera for every photograph. Photographs are those of their split,
// in their order; their ids are the paths below the folder of pictures. The caller writes the
// pictures.
Status WriteCmrLayout(const Path& folder, const PhotographSet& set);

}  // namespace tilegrad::train

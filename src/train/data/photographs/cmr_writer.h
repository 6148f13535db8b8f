// SPDX-License-Identifier: Apache-2.0
// Annotations as CMR lays out those of CUB-200 and PASCAL3D+: what OpenCmrLayout reads.
#pragma once

#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// Writes <folder>/data and <folder>/sfm; `set`: source "cub" (fifteen keypoints) or "pascal3d" with
// its class, with a mask and a camera for every photograph. Photographs are those of their split,
// in their order; their ids are the paths below the folder of pictures. The pictures are the
// caller's.
Status WriteCmrLayout(const Path& folder, const PhotographSet& set);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask/soft_mask.h"

#include "base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/soft_mask/soft_mask.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "raster/soft_mask/backward-inl.h"
#include "raster/soft_mask/forward-inl.h"
#include "raster/soft_mask/tree-inl.h"

#if HWY_ONCE

namespace tilegrad::raster {
namespace {
HWY_EXPORT(BuildSoftGroupsTarget);
HWY_EXPORT(SoftMaskForwardTarget);
HWY_EXPORT(SoftMaskBackwardTarget);
}  // namespace

void BuildSoftTree(SoftTree* tree, const Workers* workers) {
  constexpr std::size_t kChunkGroups = 16;  // that a worker takes at a time
  const std::size_t groups = tree->corners.packets() / kGroupNodes;
  tree->nodes.Resize(groups * kGroupNodes);
  tree->groups.Resize(groups);
  ForChunks(workers, groups, kChunkGroups, [&](std::size_t begin, std::size_t end) {
    HWY_DYNAMIC_DISPATCH(BuildSoftGroupsTarget)(begin, end, tree);
  });
  const float* faces = tree->groups.array(SoftBoxes::kFaces);
  tree->faces = 0;
  for (std::size_t g = 0; g < groups; ++g) tree->faces += static_cast<std::size_t>(faces[g]);
}

double SoftMaskForward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                       const SoftMaskImages& images, SoftMaskScratch* scratch) {
  return HWY_DYNAMIC_DISPATCH(SoftMaskForwardTarget)(tree, plan, region, images, scratch);
}

void SoftMaskBackward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                      const SoftMaskAdjoint& adjoint, AlignedVector<SoftFaceGradient>* out,
                      SoftMaskScratch* scratch) {
  HWY_DYNAMIC_DISPATCH(SoftMaskBackwardTarget)(tree, plan, region, adjoint, scratch, out);
}

}  // namespace tilegrad::raster
#endif

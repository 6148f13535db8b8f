// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/soft_mask.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "raster/soft_mask_backward-inl.h"
#include "raster/soft_mask_forward-inl.h"
#include "raster/soft_mask_tree-inl.h"

#if HWY_ONCE

namespace tilegrad::raster {
namespace {
HWY_EXPORT(BuildSoftTreeTarget);
HWY_EXPORT(SoftMaskForwardTarget);
HWY_EXPORT(SoftMaskBackwardTarget);
}  // namespace

void BuildSoftTree(const ScreenMesh& mesh, SoftTree* tree) {
  HWY_DYNAMIC_DISPATCH(BuildSoftTreeTarget)(mesh, tree);
}

double SoftMaskForward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                       std::span<float> alpha, SoftMaskScratch* scratch) {
  return HWY_DYNAMIC_DISPATCH(SoftMaskForwardTarget)(tree, plan, tile, alpha.data(), scratch);
}

void SoftMaskBackward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                      const SoftMaskAdjoint& adjoint, AlignedVector<SoftFaceGradient>* out,
                      SoftMaskScratch* scratch) {
  HWY_DYNAMIC_DISPATCH(SoftMaskBackwardTarget)(tree, plan, tile, adjoint, scratch, out);
}

}  // namespace tilegrad::raster
#endif

// SPDX-License-Identifier: Apache-2.0
#include "shade/combine.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/combine.cc"
#include <hwy/foreach_target.h>

#include "shade/combine-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(CombineRun);
HWY_EXPORT(CombineRunAdjoint);

void Combine(std::size_t count, const CombineInput& input, RunPlane* color) {
  HWY_DYNAMIC_DISPATCH(CombineRun)(count, input, color);
}

void CombineAdjointOf(std::size_t count, const CombineInput& input, const RunPlane* d_color,
                      const CombineAdjoint& out) {
  HWY_DYNAMIC_DISPATCH(CombineRunAdjoint)(count, input, d_color, out);
}

}  // namespace tilegrad::shade
#endif

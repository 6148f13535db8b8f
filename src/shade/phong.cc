// SPDX-License-Identifier: Apache-2.0
#include "shade/phong.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/phong.cc"
#include <hwy/foreach_target.h>

#include "shade/phong-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(PhongRun);
HWY_EXPORT(PhongRunAdjoint);

void Phong(std::size_t count, const PhongInput& input, RunPlane* highlight) {
  HWY_DYNAMIC_DISPATCH(PhongRun)(count, input, highlight);
}

void PhongAdjointOf(std::size_t count, const PhongInput& input, const RunPlane& d_highlight,
                    const PhongAdjoint& out) {
  HWY_DYNAMIC_DISPATCH(PhongRunAdjoint)(count, input, d_highlight, out);
}

}  // namespace tilegrad::shade
#endif

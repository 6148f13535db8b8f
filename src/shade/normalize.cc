// SPDX-License-Identifier: Apache-2.0
#include "shade/normalize.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/normalize.cc"
#include <hwy/foreach_target.h>

#include "shade/normalize-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(NormalizeRun);
HWY_EXPORT(NormalizeRunAdjoint);

void Normalize(std::size_t count, const RunPlane* x, float least, RunPlane* unit,
               RunPlane* inverse_length) {
  HWY_DYNAMIC_DISPATCH(NormalizeRun)(count, x, least, unit, inverse_length);
}

void NormalizeAdjoint(std::size_t count, const RunPlane* unit, const RunPlane& inverse_length,
                      const RunPlane* d_unit, RunPlane* d_x) {
  HWY_DYNAMIC_DISPATCH(NormalizeRunAdjoint)(count, unit, inverse_length, d_unit, d_x);
}

}  // namespace tilegrad::shade
#endif

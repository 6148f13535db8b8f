// SPDX-License-Identifier: Apache-2.0
#include "shade/lambert.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/lambert.cc"
#include <hwy/foreach_target.h>

#include "shade/lambert-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(LambertRun);
HWY_EXPORT(LambertRunAdjoint);

void Lambert(std::size_t count, const RunPlane* normal, const RunLights& lights, RunPlane* light) {
  HWY_DYNAMIC_DISPATCH(LambertRun)(count, normal, lights, light);
}

void LambertAdjoint(std::size_t count, const RunPlane* normal, const RunLights& lights,
                    const RunPlane& d_light, const RunLightAdjoint& out) {
  HWY_DYNAMIC_DISPATCH(LambertRunAdjoint)(count, normal, lights, d_light, out);
}

}  // namespace tilegrad::shade
#endif

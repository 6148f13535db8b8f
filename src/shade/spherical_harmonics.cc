// SPDX-License-Identifier: Apache-2.0
#include "shade/spherical_harmonics.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shade/spherical_harmonics.cc"
#include <hwy/foreach_target.h>

#include "shade/spherical_harmonics-inl.h"

#if HWY_ONCE
namespace tilegrad::shade {
HWY_EXPORT(ShLightRun);
HWY_EXPORT(ShLightRunAdjoint);

void ShLight(std::size_t count, const RunPlane* normal, const ShPolynomial& polynomial,
             RunPlane* light) {
  HWY_DYNAMIC_DISPATCH(ShLightRun)(count, normal, polynomial, light);
}

void ShLightAdjoint(std::size_t count, const RunPlane* normal, const ShPolynomial& polynomial,
                    const RunPlane& d_light, RunPlane* d_normal,
                    ShPolynomialT<double>* d_polynomial) {
  HWY_DYNAMIC_DISPATCH(ShLightRunAdjoint)
  (count, normal, polynomial, d_light, d_normal, d_polynomial);
}

}  // namespace tilegrad::shade
#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of lambert.h. Lanes are pixels.
#if defined(TILEGRAD_SHADE_RUN_LIGHTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_SHADE_RUN_LIGHTS_INL_H_
#undef TILEGRAD_SHADE_RUN_LIGHTS_INL_H_
#else
#define TILEGRAD_SHADE_RUN_LIGHTS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "shade/lambert.h"
#include "shade/run_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

HWY_INLINE std::size_t LightCount(const RunLights& lights) {
  return lights.per_pixel != nullptr ? 1 : lights.uniform.size();
}

// A light at a vector of pixels.
struct LightLanes {
  Run3 direction;
  RunVec intensity;
};

HWY_INLINE LightLanes LightAt(const RunLights& lights, std::size_t k, std::size_t i) {
  if (lights.per_pixel != nullptr) return {LoadRun3(lights.per_pixel, i), hn::Set(kRun, 1.0f)};
  const Light& l = lights.uniform[k];
  return {SetRun3(l.direction.data()), hn::Set(kRun, l.intensity)};
}

// The gradient of one light, summed over a run.
struct LightSums {
  Run3 direction;
  RunVec intensity;

  HWY_INLINE LightSums() : direction(ZeroRun3()), intensity(hn::Zero(kRun)) {}
  HWY_INLINE void AddTo(LightT<double>* light) const {
    light->direction[0] += SumOf(direction.x);
    light->direction[1] += SumOf(direction.y);
    light->direction[2] += SumOf(direction.z);
    light->intensity += SumOf(intensity);
  }
};

// Adds the gradient of the pixels' light directions.
HWY_INLINE void PullLight(const RunLightAdjoint& out, const Run3& d_direction, RunVec d_intensity,
                          std::size_t i, LightSums* sums) {
  if (out.per_pixel != nullptr) AddRun3(d_direction, out.per_pixel, i);
  sums->direction = AddScaled(sums->direction, hn::Set(kRun, 1.0f), d_direction);
  sums->intensity = hn::Add(sums->intensity, d_intensity);
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

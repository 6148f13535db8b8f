// SPDX-License-Identifier: Apache-2.0
// Vector body of lambert.h. Lanes are pixels.
#if defined(TILEGRAD_SHADE_LAMBERT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_SHADE_LAMBERT_INL_H_
#undef TILEGRAD_SHADE_LAMBERT_INL_H_
#else
#define TILEGRAD_SHADE_LAMBERT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "shade/lambert.h"
#include "shade/run_lights-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void LambertRun(std::size_t count, const RunPlane* normal, const RunLights& lights,
                RunPlane* light) {
  const RunTag d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const Run3 n = LoadRun3(normal, i);
    auto sum = hn::Zero(d);
    for (std::size_t k = 0; k < LightCount(lights); ++k) {
      const LightLanes l = LightAt(lights, k, i);
      sum = hn::MulAdd(l.intensity, hn::Max(Dot(n, l.direction), hn::Zero(d)), sum);  // (10)
    }
    StoreRun(sum, light, i);
  }
}

void LambertRunAdjoint(std::size_t count, const RunPlane* normal, const RunLights& lights,
                       const RunPlane& d_light, const RunLightAdjoint& out) {
  const RunTag d;
  for (std::size_t k = 0; k < LightCount(lights); ++k) {
    LightSums sums;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
      const Run3 n = LoadRun3(normal, i);
      const LightLanes l = LightAt(lights, k, i);
      const auto cosine = Dot(n, l.direction);
      const auto pull = hn::IfThenElseZero(hn::Ge(cosine, hn::Zero(d)), LoadRun(d_light, i));
      const auto scaled = hn::Mul(pull, l.intensity);
      if (out.d_normal != nullptr) AddRun3(Scale(scaled, l.direction), out.d_normal, i);
      PullLight(out, Scale(scaled, n), hn::Mul(pull, cosine), i, &sums);
    }
    if (!out.uniform.empty()) sums.AddTo(&out.uniform[k]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::shade
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of lambert.h. Lanes are pixels.

#include <hwy/highway.h>

#include "shade/lambert.h"
#include "shade/run_lights-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

void LambertRun(std::size_t count, const RunPlane* normal, const RunLights& lights,
                RunPlane* light) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const Run3 n = LoadRun3(normal, i);
    auto sum = hn::Zero(kRun);
    for (std::size_t k = 0; k < LightCount(lights); ++k) {
      const LightLanes l = LightAt(lights, k, i);
      sum = hn::MulAdd(l.intensity, hn::Max(Dot(n, l.direction), hn::Zero(kRun)), sum);  // (10)
    }
    StoreRun(sum, light, i);
  }
}

void LambertRunAdjoint(std::size_t count, const RunPlane* normal, const RunLights& lights,
                       const RunPlane& d_light, const RunLightAdjoint& out) {
  for (std::size_t k = 0; k < LightCount(lights); ++k) {
    LightSums sums;
    for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
      const Run3 n = LoadRun3(normal, i);
      const LightLanes l = LightAt(lights, k, i);
      const auto cosine = Dot(n, l.direction);
      const auto pull = hn::IfThenElseZero(hn::Ge(cosine, hn::Zero(kRun)), LoadRun(d_light, i));
      const auto scaled = hn::Mul(pull, l.intensity);
      if (out.d_normal != nullptr) AddRun3(Scale(scaled, l.direction), out.d_normal, i);
      PullLight(out, Scale(scaled, n), hn::Mul(pull, cosine), i, &sums);
    }
    if (!out.uniform.empty()) sums.AddTo(&out.uniform[k]);
  }
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

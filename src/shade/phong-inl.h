// SPDX-License-Identifier: Apache-2.0
// Vector body of phong.h. Lanes are pixels.

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "shade/phong.h"
#include "shade/run_lights-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

// The reflection of one light at a vector of pixels.
struct PhongLanes {
  Run3 normal, eye, light, reflected;
  RunVec cosine, toward_eye, logarithm;
  RunVec power;  // toward_eye ^ shininess
  hn::Mask<RunTag> cosine_inside, eye_inside;
};

HWY_INLINE PhongLanes ReflectLanes(const PhongInput& input, const Run3& light, std::size_t i) {
  const auto zero = hn::Zero(kRun), one = hn::Set(kRun, 1.0f),
             least = hn::Set(kRun, kLeastReflection);
  PhongLanes out;
  out.normal = LoadRun3(input.normal, i);
  out.eye = LoadRun3(input.eye, i);
  out.light = light;
  const auto cosine = Dot(out.normal, light);
  out.cosine_inside = hn::And(hn::Ge(cosine, zero), hn::Le(cosine, one));
  out.cosine = hn::Min(hn::Max(cosine, zero), one);
  const auto twice = hn::Add(out.cosine, out.cosine);
  out.reflected = AddScaled(Scale(hn::Set(kRun, -1.0f), light), twice, out.normal);  // R
  const auto toward = Dot(out.reflected, out.eye);                                   // (8): R . V
  out.eye_inside = hn::And(hn::Ge(toward, least), hn::Le(toward, one));
  out.toward_eye = hn::Min(hn::Max(toward, least), one);
  out.logarithm = hn::Log(kRun, out.toward_eye);
  out.power = hn::Exp(kRun, hn::Mul(hn::Set(kRun, input.shininess), out.logarithm));  // (8)
  return out;
}

void PhongRun(std::size_t count, const PhongInput& input, RunPlane* highlight) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    auto sum = hn::Zero(kRun);
    for (std::size_t k = 0; k < LightCount(input.lights); ++k) {
      const LightLanes l = LightAt(input.lights, k, i);
      sum = hn::MulAdd(l.intensity, ReflectLanes(input, l.direction, i).power, sum);  // (8)
    }
    StoreRun(sum, highlight, i);
  }
}

// The adjoint of ReflectLanes; d_power is dL/d(power). Returns dL/d(light direction).
HWY_INLINE Run3 PullReflection(const PhongLanes& p, RunVec d_power, const PhongInput& input,
                               const PhongAdjoint& out, std::size_t i) {
  const auto steep =
      hn::Div(hn::Mul(hn::Mul(d_power, p.power), hn::Set(kRun, input.shininess)), p.toward_eye);
  const auto d_r = hn::IfThenElseZero(p.eye_inside, steep);
  if (out.d_eye != nullptr) AddRun3(Scale(d_r, p.reflected), out.d_eye, i);
  const auto twice = hn::Add(d_r, d_r);
  const auto d_cosine = hn::IfThenElseZero(p.cosine_inside, hn::Mul(twice, Dot(p.normal, p.eye)));
  if (out.light.d_normal != nullptr) {
    const Run3 through_r = Scale(hn::Mul(twice, p.cosine), p.eye);
    AddRun3(AddScaled(through_r, d_cosine, p.light), out.light.d_normal, i);
  }
  return AddScaled(Scale(hn::Neg(d_r), p.eye), d_cosine, p.normal);
}

void PhongRunAdjoint(std::size_t count, const PhongInput& input, const RunPlane& d_highlight,
                     const PhongAdjoint& out) {
  auto d_shininess = hn::Zero(kRun);
  for (std::size_t k = 0; k < LightCount(input.lights); ++k) {
    LightSums sums;
    for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
      const LightLanes l = LightAt(input.lights, k, i);
      const PhongLanes p = ReflectLanes(input, l.direction, i);
      const auto d_light = LoadRun(d_highlight, i), d_power = hn::Mul(d_light, l.intensity);
      d_shininess = hn::MulAdd(hn::Mul(d_power, p.power), p.logarithm, d_shininess);
      PullLight(out.light, PullReflection(p, d_power, input, out, i), hn::Mul(d_light, p.power), i,
                &sums);
    }
    if (!out.light.uniform.empty()) sums.AddTo(&out.light.uniform[k]);
  }
  if (out.d_shininess != nullptr) *out.d_shininess += SumOf(d_shininess);
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

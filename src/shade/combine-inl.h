// SPDX-License-Identifier: Apache-2.0
// Vector body of combine.h. Lanes are pixels.

#include <hwy/highway.h>

#include "shade/combine.h"
#include "shade/run_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

// One channel of a vector of pixels.
struct CombineLanes {
  RunVec texture, vertex_color;
  RunVec plain;    // texture * vertex colour
  RunVec surface;  // I_c
  RunVec light;    // I_l
  RunVec color;    // before the clamp
};

HWY_INLINE CombineLanes CombineChannel(const CombineInput& input, std::size_t c, std::size_t i) {
  const auto one = hn::Set(kRun, 1.0f);
  CombineLanes out;
  out.texture = input.texture != nullptr ? LoadRun(input.texture[c], i) : one;
  out.vertex_color = input.vertex_color != nullptr ? LoadRun(input.vertex_color[c], i) : one;
  out.plain = hn::Mul(out.texture, out.vertex_color);
  out.surface = hn::Mul(hn::Set(kRun, input.factors.base[c]), out.plain);  // (7): I_c
  out.light = one;
  if (input.light != nullptr) {
    out.light = hn::MulAdd(hn::Set(kRun, input.factors.diffuse[c]), LoadRun(*input.light, i),
                           hn::Set(kRun, input.factors.ambient[c]));  // (7): I_l
  }
  out.color = hn::Mul(out.light, out.surface);  // (7): I_l I_c
  if (input.highlight != nullptr) {
    out.color = hn::MulAdd(hn::Set(kRun, input.factors.specular[c]), LoadRun(*input.highlight, i),
                           out.color);
  }
  return out;
}

void CombineRun(std::size_t count, const CombineInput& input, RunPlane* color) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    for (std::size_t c = 0; c < 3; ++c) {
      auto value = CombineChannel(input, c, i).color;
      if (input.clamp) value = hn::Min(hn::Max(value, hn::Zero(kRun)), hn::Set(kRun, 1.0f));
      StoreRun(value, &color[c], i);
    }
  }
}

// Gradients of the factors of one channel, summed over a run.
struct FactorSums {
  RunVec base, ambient, diffuse, specular;

  HWY_INLINE FactorSums() { base = ambient = diffuse = specular = hn::Zero(kRun); }
  HWY_INLINE void AddTo(std::size_t c, ColorFactorsT<double>* out) const {
    out->base[c] += SumOf(base);
    out->ambient[c] += SumOf(ambient);
    out->diffuse[c] += SumOf(diffuse);
    out->specular[c] += SumOf(specular);
  }
};

// Channel 0 sets the gradient shared by all channels, the others add to it.
HWY_INLINE void PullAll(RunVec v, std::size_t c, RunPlane* to, std::size_t i) {
  StoreRun(c == 0 ? v : hn::Add(LoadRun(*to, i), v), to, i);
}

HWY_INLINE void CombineChannelAdjoint(const CombineInput& input, const RunPlane& d_color,
                                      std::size_t c, const CombineAdjoint& out, std::size_t i,
                                      FactorSums* sums) {
  const CombineLanes at = CombineChannel(input, c, i);
  auto pull = LoadRun(d_color, i);
  if (input.clamp) {
    const auto inside =
        hn::And(hn::Ge(at.color, hn::Zero(kRun)), hn::Le(at.color, hn::Set(kRun, 1.0f)));
    pull = hn::IfThenElseZero(inside, pull);
  }
  const auto d_surface = hn::Mul(pull, at.light);
  const auto d_plain = hn::Mul(d_surface, hn::Set(kRun, input.factors.base[c]));
  if (out.d_texture != nullptr) StoreRun(hn::Mul(d_plain, at.vertex_color), &out.d_texture[c], i);
  if (out.d_vertex_color != nullptr) {
    StoreRun(hn::Mul(d_plain, at.texture), &out.d_vertex_color[c], i);
  }
  sums->base = hn::MulAdd(d_surface, at.plain, sums->base);
  if (input.light != nullptr) {
    const auto d_light = hn::Mul(pull, at.surface);
    sums->ambient = hn::Add(sums->ambient, d_light);
    sums->diffuse = hn::MulAdd(d_light, LoadRun(*input.light, i), sums->diffuse);
    if (out.d_light != nullptr) {
      PullAll(hn::Mul(d_light, hn::Set(kRun, input.factors.diffuse[c])), c, out.d_light, i);
    }
  }
  if (input.highlight == nullptr) return;
  sums->specular = hn::MulAdd(pull, LoadRun(*input.highlight, i), sums->specular);
  if (out.d_highlight != nullptr) {
    PullAll(hn::Mul(pull, hn::Set(kRun, input.factors.specular[c])), c, out.d_highlight, i);
  }
}

void CombineRunAdjoint(std::size_t count, const CombineInput& input, const RunPlane* d_color,
                       const CombineAdjoint& out) {
  for (std::size_t c = 0; c < 3; ++c) {
    FactorSums sums;
    for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
      CombineChannelAdjoint(input, d_color[c], c, out, i, &sums);
    }
    if (out.d_factors != nullptr) sums.AddTo(c, out.d_factors);
  }
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

// SPDX-License-Identifier: Apache-2.0
// Vector body of normalize.h. Lanes are pixels.

#include <hwy/highway.h>

#include "shade/normalize.h"
#include "shade/run_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

void NormalizeRun(std::size_t count, const RunPlane* x, float least, RunPlane* unit,
                  RunPlane* inverse_length) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const Run3 v = LoadRun3(x, i);
    const auto square = Dot(v, v);
    const auto has = hn::Gt(square, hn::Set(kRun, least));
    const auto inverse = hn::IfThenElseZero(has, hn::Div(hn::Set(kRun, 1.0f), hn::Sqrt(square)));
    StoreRun3(Scale(inverse, v), unit, i);
    StoreRun(inverse, inverse_length, i);
  }
}

void NormalizeRunAdjoint(std::size_t count, const RunPlane* unit, const RunPlane& inverse_length,
                         const RunPlane* d_unit, RunPlane* d_x) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const Run3 u = LoadRun3(unit, i), du = LoadRun3(d_unit, i);
    const Run3 across = AddScaled(du, hn::Neg(Dot(u, du)), u);
    StoreRun3(Scale(LoadRun(inverse_length, i), across), d_x, i);
  }
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

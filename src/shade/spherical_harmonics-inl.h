// SPDX-License-Identifier: Apache-2.0
// Vector body of spherical_harmonics.h. Lanes are pixels.

#include <hwy/highway.h>

#include "shade/run_lanes-inl.h"
#include "shade/spherical_harmonics.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {

HWY_INLINE hn::Mask<RunTag> HasDirectionLanes(const Run3& n) {
  return hn::Gt(Dot(n, n), hn::Zero(kRun));
}

struct MonomialLanes {
  RunVec at[9];
};

HWY_INLINE MonomialLanes MonomialsOf(const Run3& n) {
  const auto difference = hn::Mul(hn::Sub(n.x, n.y), hn::Add(n.x, n.y));
  return {{hn::Set(kRun, 1.0f), n.x, n.y, n.z, hn::Mul(n.x, n.y), hn::Mul(n.y, n.z),
           hn::Mul(n.z, n.z), hn::Mul(n.x, n.z), difference}};
}

void ShLightRun(std::size_t count, const RunPlane* normal, const ShPolynomial& p, RunPlane* light) {
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const Run3 n = LoadRun3(normal, i);
    const MonomialLanes m = MonomialsOf(n);
    auto sum = hn::Set(kRun, p[0]);
    for (int k = 1; k < 9; ++k) sum = hn::MulAdd(hn::Set(kRun, p[k]), m.at[k], sum);  // (11)
    StoreRun(hn::IfThenElseZero(HasDirectionLanes(n), sum), light, i);
  }
}

// Gradient of the polynomial.
HWY_INLINE Run3 ShSlope(const ShPolynomial& p, const Run3& n) {
  const auto set = [&](int k) HWY_ATTR { return hn::Set(kRun, p[k]); };
  const auto x2 = hn::Add(n.x, n.x), y2 = hn::Add(n.y, n.y), z2 = hn::Add(n.z, n.z);
  const auto along_x =
      hn::MulAdd(set(4), n.y, hn::MulAdd(set(7), n.z, hn::MulAdd(set(8), x2, set(1))));
  const auto along_y =
      hn::MulAdd(set(4), n.x, hn::MulAdd(set(5), n.z, hn::NegMulAdd(set(8), y2, set(2))));
  const auto along_z =
      hn::MulAdd(set(5), n.y, hn::MulAdd(set(6), z2, hn::MulAdd(set(7), n.x, set(3))));
  return {along_x, along_y, along_z};
}

void ShLightRunAdjoint(std::size_t count, const RunPlane* normal, const ShPolynomial& p,
                       const RunPlane& d_light, RunPlane* d_normal,
                       ShPolynomialT<double>* d_polynomial) {
  MonomialLanes sums;
  for (auto& sum : sums.at) sum = hn::Zero(kRun);
  for (std::size_t i = 0; i < count; i += hn::Lanes(kRun)) {
    const Run3 n = LoadRun3(normal, i);
    const auto pull = hn::IfThenElseZero(HasDirectionLanes(n), LoadRun(d_light, i));
    if (d_normal != nullptr) AddRun3(Scale(pull, ShSlope(p, n)), d_normal, i);
    if (d_polynomial == nullptr) continue;
    const MonomialLanes m = MonomialsOf(n);
    for (int k = 0; k < 9; ++k) sums.at[k] = hn::MulAdd(pull, m.at[k], sums.at[k]);
  }
  if (d_polynomial == nullptr) return;
  for (int k = 0; k < 9; ++k) (*d_polynomial)[k] += SumOf(sums.at[k]);
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

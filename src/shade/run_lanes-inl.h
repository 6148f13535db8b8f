// SPDX-License-Identifier: Apache-2.0
// Vector body of pixel_run.h. Lanes are pixels.
#if defined(TILEGRAD_SHADE_RUN_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_SHADE_RUN_LANES_INL_H_
#undef TILEGRAD_SHADE_RUN_LANES_INL_H_
#else
#define TILEGRAD_SHADE_RUN_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "shade/pixel_run.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::shade::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using RunTag = hn::ScalableTag<float>;
inline constexpr RunTag kRun;
using RunVec = hn::Vec<RunTag>;

HWY_INLINE RunVec LoadRun(const RunPlane& p, std::size_t i) { return hn::Load(kRun, p.at + i); }
HWY_INLINE void StoreRun(RunVec v, RunPlane* p, std::size_t i) { hn::Store(v, kRun, p->at + i); }
HWY_INLINE void AddRun(RunVec v, RunPlane* p, std::size_t i) {
  StoreRun(hn::Add(LoadRun(*p, i), v), p, i);
}

// Three numbers of each pixel.
struct Run3 {
  RunVec x, y, z;
};

HWY_INLINE Run3 LoadRun3(const RunPlane* p, std::size_t i) {
  return {LoadRun(p[0], i), LoadRun(p[1], i), LoadRun(p[2], i)};
}
HWY_INLINE void StoreRun3(const Run3& v, RunPlane* p, std::size_t i) {
  StoreRun(v.x, &p[0], i);
  StoreRun(v.y, &p[1], i);
  StoreRun(v.z, &p[2], i);
}
HWY_INLINE void AddRun3(const Run3& v, RunPlane* p, std::size_t i) {
  AddRun(v.x, &p[0], i);
  AddRun(v.y, &p[1], i);
  AddRun(v.z, &p[2], i);
}

HWY_INLINE RunVec Dot(const Run3& a, const Run3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
// a + s b
HWY_INLINE Run3 AddScaled(const Run3& a, RunVec s, const Run3& b) {
  return {hn::MulAdd(s, b.x, a.x), hn::MulAdd(s, b.y, a.y), hn::MulAdd(s, b.z, a.z)};
}
HWY_INLINE Run3 Scale(RunVec s, const Run3& a) {
  return {hn::Mul(s, a.x), hn::Mul(s, a.y), hn::Mul(s, a.z)};
}
HWY_INLINE Run3 ZeroRun3() { return {hn::Zero(kRun), hn::Zero(kRun), hn::Zero(kRun)}; }
HWY_INLINE Run3 SetRun3(const float* v) {
  return {hn::Set(kRun, v[0]), hn::Set(kRun, v[1]), hn::Set(kRun, v[2])};
}

HWY_INLINE double SumOf(RunVec v) {
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(kRun, v)));
}

}  // namespace tilegrad::shade::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

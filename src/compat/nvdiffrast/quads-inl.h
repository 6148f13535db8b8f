// SPDX-License-Identifier: Apache-2.0
// Four numbers of a pixel, a vertex or a texel as lanes: images and textures interleave channels,
// so kernels process rows of any length by quads, the last of which reaches into the next row. What
// it reads there is ignored, and what it writes there is overwritten, since rows are written in
// order; only the end of an array needs care.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_QUADS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_QUADS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_QUADS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_QUADS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using QuadTag = hn::FixedTag<float, 4>;
inline constexpr QuadTag kQuad;
using Quad = hn::Vec<QuadTag>;
using QuadMask = hn::Mask<QuadTag>;

// Adjacent pixels whose contributions are summed separately before they join a longer sum, so that
// the rounding of many equal ones does not accumulate.
inline constexpr int kMostRun = 64;

inline HWY_NOINLINE Quad LoadShortQuad(const float* from, const float* end) {
  HWY_ALIGN float some[4] = {};
  std::memcpy(some, from, static_cast<std::size_t>(end - from) * sizeof(float));
  return hn::Load(kQuad, some);
}
inline HWY_NOINLINE void StoreShortQuad(Quad v, float* to, const float* end) {
  HWY_ALIGN float some[4];
  hn::Store(v, kQuad, some);
  std::memcpy(to, some, static_cast<std::size_t>(end - to) * sizeof(float));
}

// Up to four numbers, those before `end`. kWhole: all four are.
template <bool kWhole = false>
HWY_INLINE Quad LoadQuad(const float* from, const float* end) {
  if (kWhole || HWY_LIKELY(end - from >= 4)) return hn::LoadU(kQuad, from);
  return LoadShortQuad(from, end);
}
template <bool kWhole = false>
HWY_INLINE void StoreQuad(Quad v, float* to, const float* end) {
  if (kWhole || HWY_LIKELY(end - to >= 4)) return hn::StoreU(v, kQuad, to);
  StoreShortQuad(v, to, end);
}

// Faster than std::fill, which uses rep stos even for a few kilobytes.
HWY_INLINE void WriteZeros(float* to, float* end) {
  const hn::ScalableTag<float> d;
  const auto lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  for (; end - to >= lanes; to += lanes) hn::StoreU(hn::Zero(d), d, to);
  for (; to < end; ++to) *to = 0;
}

// Channel 3 of a vector of pixels of rast, as IsFaceId has it.
template <class D>
struct FaceIds {
  hn::Vec<hn::RebindToSigned<D>> number;  // 0 where there is no such face
  hn::Mask<D> exists;

  HWY_INLINE FaceIds(D d, hn::Vec<D> id, float faces) {
    const hn::RebindToSigned<D> di;
    const auto integer = hn::ConvertTo(di, id);
    const auto in_range = hn::And(hn::Ge(id, hn::Zero(d)), hn::Le(id, hn::Set(d, faces)));
    exists = hn::And(hn::Eq(hn::ConvertTo(d, integer), id), in_range);
    number = hn::IfThenElseZero(hn::RebindMask(di, exists), integer);
  }
  // *bad <- the least of *bad and the index of the first pixel whose face does not exist, `first`
  // being that of lane 0.
  HWY_INLINE void Find(D d, std::size_t first, std::size_t* bad) const {
    if (HWY_LIKELY(hn::AllTrue(d, exists))) return;
    const auto lane = static_cast<std::size_t>(hn::FindFirstTrue(d, hn::Not(exists)));
    *bad = HWY_MIN(*bad, first + lane);
  }
};

// The lanes from number `first` on that are below `count`.
HWY_INLINE QuadMask LanesBelow(std::size_t first, std::size_t count) {
  return hn::FirstN(kQuad, HWY_MIN(count - first, std::size_t{4}));
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

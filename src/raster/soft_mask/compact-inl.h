// SPDX-License-Identifier: Apache-2.0
// Appends selected lanes to arrays. Where masks are not registers, this Highway's hn::CompressStore
// copies its table to the stack on every call.

#if defined(TILEGRAD_RASTER_SOFT_MASK_COMPACT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_COMPACT_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_COMPACT_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_COMPACT_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>

#include "raster/soft_mask/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// Brings the chosen lanes to the front, in order.
class Compactor {
 public:
  HWY_INLINE Compactor(SoftTag d, SoftMask chosen) {
    const std::uint32_t bits = BitsOf(d, chosen);
    count_ = static_cast<std::size_t>(std::popcount(bits));
    const hn::Rebind<std::uint8_t, SoftTag> bytes;
    const auto lanes = hn::PromoteTo(SoftIntTag(), hn::LoadU(bytes, kChosenLanes.lane[bits]));
    floats_ = hn::IndicesFromVec(SoftTag(), lanes);
    ints_ = hn::IndicesFromVec(SoftIntTag(), lanes);
  }
  std::size_t count() const { return count_; }
  // A whole vector is written.
  HWY_INLINE void Store(SoftVec v, float* to) const {
    hn::StoreU(hn::TableLookupLanes(v, floats_), SoftTag(), to);
  }
  HWY_INLINE void Store(SoftInt v, std::int32_t* to) const {
    hn::StoreU(hn::TableLookupLanes(v, ints_), SoftIntTag(), to);
  }

 private:
  decltype(hn::IndicesFromVec(SoftTag(), SoftInt())) floats_;
  decltype(hn::IndicesFromVec(SoftIntTag(), SoftInt())) ints_;
  std::size_t count_;
};

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

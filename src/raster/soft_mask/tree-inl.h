// SPDX-License-Identifier: Apache-2.0
// Vector body of tree.h. Lanes are faces, nodes, groups.

#if defined(TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>

#include "raster/face_lanes-inl.h"
#include "raster/soft_mask/plan.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SoftTag = hn::CappedTag<float, kSoftLanes>;
using SoftVec = hn::Vec<SoftTag>;
using SoftMask = hn::Mask<SoftTag>;
using SoftIntTag = hn::RebindToSigned<SoftTag>;
using SoftInt = hn::Vec<SoftIntTag>;

// A lower bound of the squared distance between lanes of boxes and one box, kernel units. Each side
// is subtracted with one rounding, so the relative error is at most 8 u, which the last factor
// covers.
HWY_INLINE SoftVec BoxDistance(SoftTag d, SoftVec left, SoftVec top, SoftVec right, SoftVec bottom,
                               const SoftBox& box) {
  const SoftVec zero = hn::Zero(d);
  const auto gap_x =
      hn::Max(hn::Sub(left, hn::Set(d, box.right)), hn::Sub(hn::Set(d, box.left), right));
  const auto gap_y =
      hn::Max(hn::Sub(top, hn::Set(d, box.bottom)), hn::Sub(hn::Set(d, box.top), bottom));
  const auto x = hn::Mul(hn::Max(gap_x, zero), hn::Set(d, box.unit_x));
  const auto y = hn::Mul(hn::Max(gap_y, zero), hn::Set(d, box.unit_y));
  return hn::Mul(hn::MulAdd(x, x, hn::Mul(y, y)), hn::Set(d, 1 - 0x1p-20f));
}

HWY_INLINE SoftVec BoxDistance(SoftTag d, const SoftBoxes& boxes, std::size_t i,
                               const SoftBox& box) {
  const auto side = [&](SoftBoxes::Array a) HWY_ATTR { return hn::LoadU(d, boxes.array(a) + i); };
  return BoxDistance(d, side(SoftBoxes::kLeft), side(SoftBoxes::kTop), side(SoftBoxes::kRight),
                     side(SoftBoxes::kBottom), box);
}

// The box around boxes [from, from + n).
template <class Load>
HWY_INLINE void StoreBox(SoftTag d, std::size_t n, const Load& load, std::size_t at,
                         SoftBoxes* out) {
  for (std::size_t a = 0; a < 4; ++a) {
    const bool low = a < SoftBoxes::kRight;
    SoftVec v = load(0, a);
    for (std::size_t i = hn::Lanes(d); i < n; i += hn::Lanes(d)) {
      v = low ? hn::Min(v, load(i, a)) : hn::Max(v, load(i, a));
    }
    out->array(a)[at] = hn::GetLane(low ? hn::MinOfLanes(d, v) : hn::MaxOfLanes(d, v));
  }
}

HWY_INLINE void StoreNode(SoftTag d, std::size_t node, SoftTree* tree) {
  std::size_t faces = 0;
  for (std::size_t f = 0; f < kNodeFaces; f += hn::Lanes(d)) {
    const SoftVec corner = hn::Load(d, tree->corners.at(node, 0) + f);
    faces += hn::CountTrue(d, hn::Lt(corner, hn::Set(d, kNowhere)));
  }
  tree->nodes.array(SoftBoxes::kFaces)[node] = static_cast<float>(faces);
  StoreBox(
      d, kNodeFaces,
      [&](std::size_t i, std::size_t a) HWY_ATTR {
        const std::size_t axis = a == SoftBoxes::kLeft || a == SoftBoxes::kRight ? 0 : 3;
        const auto corner = [&](std::size_t k) HWY_ATTR {
          const SoftVec at = hn::Load(d, tree->corners.at(node, axis + k) + i);
          // On the far side, too, a face out of reach must not widen a box.
          return a < SoftBoxes::kRight
                     ? at
                     : hn::IfThenElse(hn::Eq(at, hn::Set(d, kNowhere)), hn::Set(d, -kNowhere), at);
        };
        return a < SoftBoxes::kRight ? hn::Min(hn::Min(corner(0), corner(1)), corner(2))
                                     : hn::Max(hn::Max(corner(0), corner(1)), corner(2));
      },
      node, &tree->nodes);
}

HWY_INLINE void StoreGroup(SoftTag d, std::size_t group, SoftTree* tree) {
  const std::size_t first = group * kGroupNodes;
  float faces = 0;
  for (std::size_t n = first; n < first + kGroupNodes; ++n) {
    faces += tree->nodes.array(SoftBoxes::kFaces)[n];
  }
  tree->groups.array(SoftBoxes::kFaces)[group] = faces;
  StoreBox(
      d, kGroupNodes,
      [&](std::size_t i, std::size_t a)
          HWY_ATTR { return hn::LoadU(d, tree->nodes.array(a) + first + i); },
      group, &tree->groups);
}

// Builds groups [begin, end) and everything in them.
inline void BuildSoftGroupsTarget(std::size_t begin, std::size_t end, SoftTree* tree) {
  const SoftTag d;
  for (std::size_t n = begin * kGroupNodes; n < end * kGroupNodes; ++n) StoreNode(d, n, tree);
  for (std::size_t g = begin; g < end; ++g) StoreGroup(d, g, tree);
}

// Appends selected lanes to arrays. Where masks are not registers, this Highway's hn::CompressStore
// copies its table to the stack on every call.

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
  // Writes a whole vector.
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

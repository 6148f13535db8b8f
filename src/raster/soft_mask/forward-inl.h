// SPDX-License-Identifier: Apache-2.0
// Alpha of a block's pixels. Lanes are faces, pixels are in the loop; lanes are merged per chunk.

#if defined(TILEGRAD_RASTER_SOFT_MASK_FORWARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_FORWARD_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_FORWARD_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_FORWARD_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "raster/soft_mask/members-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// Equation 6 for one more face: a + (1 - a) A. Keeps small alphas precise, unlike 1 - product.
HWY_INLINE SoftVec Over(SoftTag d, SoftVec a, SoftVec influence) {
  return hn::MulAdd(hn::Sub(hn::Set(d, 1.0f), a), influence, a);  // (6)
}

// Alpha over the members of a chunk, per pixel and lane of a block.
class PartialAlpha {
 public:
  // Uses scratch->lists. scratch->partial must be 0, and is 0 again after Merge.
  PartialAlpha(SoftBlock* block, SoftMaskScratch* scratch)
      : lists_(scratch->lists), block_(block), partial_(scratch->partial), work_(&scratch->work) {}

  HWY_INLINE void AddVertices() {
    const SoftTag d;
    const auto& list = lists_.vertices;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      MergeBefore(m);
      const std::uint64_t bits = See(list, m);
      if (bits == 0) continue;
      NoteVertexPairs(d, bits, work_);
      const VertexMembers<false> members(d, list, m, *block_, bits);
      ForPixels(bits, [&](std::size_t i) HWY_ATTR { Put(d, i, members.Influence(i)); });
    }
  }

  HWY_INLINE void AddSegments() {
    const SoftTag d;
    const auto& list = lists_.segments;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      MergeBefore(m);
      const EdgeMembers members(d, list.v[0] + m, list.kRoom);
      AddDistances(See(list, m), [&](std::size_t i)
                                     HWY_ATTR { return SquaredLength(members.At(d, *block_, i)); });
    }
  }

  HWY_INLINE void AddBoundaries() {
    const SoftTag d;
    const auto& list = lists_.boundaries;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      MergeBefore(m);
      const BoundaryMembers members(d, list.v[0] + m, list.kRoom);
      AddDistances(See(list, m), [&](std::size_t i) HWY_ATTR { return members.Z(d, *block_, i); });
    }
  }

  // Merges into the block's alpha, in double.
  HWY_INLINE void Merge() {
    const SoftTag d;
    ForPixels(touched_, [&](std::size_t i) HWY_ATTR {
      const SoftVec lanes = hn::Load(d, partial_[i]);
      hn::Store(hn::Zero(d), d, partial_[i]);
      SoftVec a = lanes;
      if constexpr (hn::MaxLanes(d) > 4) a = Over(d, a, NextQuartet(d, a));
      a = Over(d, a, NextPair(d, a));
      a = Over(d, a, Neighbour(d, a));
      const auto alpha = static_cast<double>(hn::GetLane(a));
      block_->alpha[i] += (1 - block_->alpha[i]) * alpha;  // (6)
      block_->product[i] *= 1 - alpha >= kLightProduct ? 1 - alpha : SmallProduct(d, lanes, i);
    });
    touched_ = 0;
  }

 private:
  // Call before member m. Merges after every kChunkFaces members, so that rounding in the lanes
  // stays bounded; only the backward pass has longer lists.
  HWY_INLINE void MergeBefore(std::size_t m) {
    if (m != 0 && m % kChunkFaces == 0) Merge();
  }
  // The pixels that see a vector of members.
  HWY_INLINE std::uint64_t See(const SoftList& list, std::size_t m) {
    const std::uint64_t bits = PixelsOf(SoftTag(), lists_, list, m, block_->live);
    touched_ |= bits;
    return bits;
  }
  // Two loops, so that iterations overlap instead of forming one chain from distance to alpha.
  template <class Distance>
  HWY_INLINE void AddDistances(std::uint64_t bits, const Distance& z) {
    const SoftTag d;
    NotePairs(d, bits, work_);
    alignas(64) float of_pixel[kBlockPixels][kSoftLanes];
    ForPixels(bits, [&](std::size_t i) HWY_ATTR { hn::Store(z(i), d, of_pixel[i]); });
    ForPixels(bits, [&](std::size_t i) HWY_ATTR {
      Put(d, i, simd::Exp2Neg(d, hn::Load(d, of_pixel[i])).power);  // (5): A = 2^-z
    });
  }
  // The product of the lanes' 1 - a, for 1 - alpha that has lost its digits. Records the least
  // lane.
  HWY_INLINE double SmallProduct(SoftTag d, SoftVec a, std::size_t pixel) {
    SoftVec left = hn::Sub(hn::Set(d, 1.0f), a);
    const SoftMask dark = hn::Lt(left, hn::Set(d, static_cast<float>(kLightProduct)));
    const SoftVec rounding = hn::Set(d, static_cast<float>(LaneRounding(hn::MaxLanes(d))));
    left = hn::Add(left, hn::IfThenElseZero(dark, rounding));
    // Keeps a dark lane dark: rounding leaves its product too few digits for a gradient.
    const SoftVec noted = hn::IfThenElse(dark, hn::Min(left, hn::Set(d, kMostDark)), left);
    block_->least[pixel] = std::min(block_->least[pixel], hn::GetLane(hn::MinOfLanes(d, noted)));
    return static_cast<double>(hn::GetLane(LaneProducts(d, left).all));
  }
  HWY_INLINE void Put(SoftTag d, std::size_t pixel, SoftVec influence) {
    float* at = partial_[pixel];
    hn::Store(Over(d, hn::Load(d, at), influence), d, at);
  }

  const SoftLists& lists_;
  SoftBlock* block_;
  float (*partial_)[kSoftLanes];
  SoftWork* work_;
  std::uint64_t touched_ = 0;
};

// Stops pixels whose product is within `stop`: they need no more faces. Where others may matter for
// the gradient, the backward pass processes them.
HWY_INLINE void StopPixels(const SoftMaskPlan& plan, double stop, SoftBlock* block) {
  ForPixels(block->live, [&](std::size_t i) {
    if (1 - block->alpha[i] > stop) return;
    block->live &= ~(std::uint64_t{1} << i);
    const auto least = static_cast<double>(block->least[i]);
    if (!IsUnseen(plan, block->product[i], least)) block->least[i] = 0;
  });
}

// The error spent by the block: for stopped pixels, their product; for others, the dropped faces.
HWY_INLINE double SpentBy(const SoftBlock& block, const SoftNodes& nodes, double share) {
  double spent = 0;
  if (block.live != 0) {
    spent = nodes.dropped + static_cast<double>(nodes.faces - block.whole) * share;
  }
  ForPixels(block.bits & ~block.live, [&](std::size_t i) {
    const double product = 1 - block.alpha[i];
    if (product > kUnseenProduct) spent = std::max(spent, product);
  });
  return std::min(spent, 1.0);
}

// Copies a row of a block to an image. By quads, like the writes of rows: store forwarding to a
// wider load would fail.
HWY_INLINE void CopyRow(const float (&row)[kBlockSize], std::size_t width, float* to) {
  const QuadTag d;
  if (width < kBlockSize) {
    std::copy_n(row, width, to);
    return;
  }
  for (std::size_t x = 0; x < kBlockSize; x += hn::Lanes(d)) {
    hn::StoreU(hn::Load(d, row + x), d, to + x);
  }
}

// Alpha of a tile before any face: 0 for the background, else 1.
HWY_INLINE void WriteClear(const SoftMaskPlan& plan, const PixelRect& rect,
                           const TilePixels& background, float* image) {
  const TileTag d;
  const auto width = static_cast<std::size_t>(rect.x1 - rect.x0);
  for (int y = rect.y0; y < rect.y1; ++y) {
    const std::uint32_t row = background.row(static_cast<std::size_t>(y - rect.y0));
    float* to = image + PixelIndex(plan, rect.x0, y);
    if (width < static_cast<std::size_t>(kTileSize)) {
      for (std::size_t x = 0; x < width; ++x) to[x] = static_cast<float>(~row >> x & 1);
      continue;
    }
    for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
      hn::StoreU(hn::IfThenZeroElse(MaskOf(d, row >> x), hn::Set(d, 1.0f)), d, to + x);
    }
  }
}

// The transmittance of background pixels: see SoftBlock.
template <class V>
HWY_INLINE V Transmittance(const SoftMaskPlan& plan, V product, V least) {
  const SoftNarrowTag d;
  const auto set = [&](double v) HWY_ATTR { return hn::Set(d, static_cast<float>(v)); };
  const auto unseen = hn::Le(product, hn::Mul(least, set(kUnseenShare * plan.stop_error)));
  const auto known = hn::Ge(least, set(kLightProduct));
  return hn::IfThenZeroElse(unseen, hn::IfThenElse(known, product, set(kUnknownTransmittance)));
}

HWY_INLINE void WriteAlpha(const SoftMaskPlan& plan, const SoftBlock& block, float* image) {
  const SoftDoubleTag d;
  const auto size = static_cast<std::size_t>(block.width);
  ForRows(plan, block, [&](std::size_t to, std::size_t from) HWY_ATTR {
    alignas(64) float alpha[kBlockSize];
    for (std::size_t x = 0; x < kBlockSize; x += hn::Lanes(d)) {
      const auto row = hn::Load(d, block.alpha + from + x);
      hn::Store(hn::DemoteTo(SoftNarrowTag(), row), SoftNarrowTag(), alpha + x);
    }
    CopyRow(alpha, size, image + to);
  });
}

HWY_INLINE void WriteTransmittance(const SoftMaskPlan& plan, const SoftBlock& block,
                                   float* transmittance) {
  const SoftDoubleTag d;
  const SoftNarrowTag d_written;
  const auto size = static_cast<std::size_t>(block.width);
  float* to = transmittance + TransmittanceIndex(plan, block);
  ForRows(plan, block, [&](std::size_t, std::size_t from) HWY_ATTR {
    alignas(64) float row[kBlockSize];
    for (std::size_t x = 0; x < kBlockSize; x += hn::Lanes(d)) {
      const auto product = hn::DemoteTo(d_written, hn::Load(d, block.product + from + x));
      hn::Store(Transmittance(plan, product, hn::Load(d_written, block.least + from + x)),
                d_written, row + x);
    }
    CopyRow(row, size, to);
    to += size;
  });
}

HWY_INLINE void PrefetchTransmittance(const SoftMaskPlan& plan, const SoftBlock* blocks,
                                      std::span<const float> transmittance) {
  for (std::size_t b = 0; b < kTileBlocks; ++b) {
    if (blocks[b].bits == 0) continue;
    PrefetchNumbers(transmittance.data() + TransmittanceIndex(plan, blocks[b]),
                    static_cast<std::size_t>(blocks[b].width * blocks[b].height));
  }
}

// Alpha of the blocks of a tile over the faces of `nodes`.
HWY_INLINE void FindAlpha(const SoftTree& tree, const SoftMaskPlan& plan, const SoftBox& box,
                          const SoftNodes& nodes, const SoftReach& reach,
                          SoftMaskScratch* scratch) {
  SoftBlock* blocks = scratch->blocks;
  const double stop = StopProduct(plan);
  const TileFaces faces{tree, std::span(scratch->nodes).first(nodes.count), box, reach.z,
                        kChunkFaces};
  for (std::size_t next = 0; next < nodes.count && AnyLive(blocks);) {
    FillChunk(faces, &next, &scratch->chunk);
    for (std::size_t b = 0; b < kTileBlocks; ++b) {
      if (blocks[b].live == 0) continue;
      FindFeatures(scratch->chunk, plan, {blocks[b], blocks[b].live, reach, false},
                   &scratch->lists);
      if (scratch->lists.empty()) continue;
      if (blocks[b].clear) ClearAlpha(&blocks[b]);
      blocks[b].whole += scratch->lists.whole;
      PartialAlpha partial(&blocks[b], scratch);
      partial.AddVertices();
      partial.AddSegments();
      partial.AddBoundaries();
      partial.Merge();
      if (next < nodes.count) StopPixels(plan, stop, &blocks[b]);
    }
  }
}

// One tile, after FindNearGroups. Returns the error spent.
inline double TileForward(const SoftTree& tree, const SoftMaskPlan& plan,
                          const SoftMaskRegion& tile, const SoftMaskImages& images,
                          SoftMaskScratch* scratch) {
  SoftBlock* blocks = scratch->blocks;
  const TilePixels background = BackgroundOf(plan, tile);
  WriteClear(plan, tile.rect, background, images.alpha.data());
  if (background.none()) return 0;
  const SoftBox box = SetUpBlocks(
      plan, tile.rect, [&](const SoftBlock&, std::size_t b) { return background.of(b); }, blocks);
  const SoftNodes nodes = FindSoftNodes(tree, plan, box, scratch);
  if (nodes.count == 0) return std::min(nodes.dropped, 1.0);
  const SoftReach reach = ReachOf(plan, nodes.faces);
  if (!images.transmittance.empty()) PrefetchTransmittance(plan, blocks, images.transmittance);
  FindAlpha(tree, plan, box, nodes, reach, scratch);
  double spent = 0;
  for (std::size_t b = 0; b < kTileBlocks; ++b) {
    if (blocks[b].bits != 0) spent = std::max(spent, SpentBy(blocks[b], nodes, reach.share));
    if (blocks[b].clear) continue;
    WriteAlpha(plan, blocks[b], images.alpha.data());
    if (!images.transmittance.empty()) {
      WriteTransmittance(plan, blocks[b], images.transmittance.data());
    }
  }
  return spent;
}

inline double SoftMaskForwardTarget(const SoftTree& tree, const SoftMaskPlan& plan,
                                    const SoftMaskRegion& region, const SoftMaskImages& images,
                                    SoftMaskScratch* scratch) {
  FindNearGroups(tree, plan, region.rect, &scratch->groups);
  double spent = 0;
  ForTiles(region.rect, [&](const PixelRect& tile) HWY_ATTR {
    PrefetchTile(plan, NextTile(region.rect, tile), images.alpha.data());
    spent = std::max(spent, TileForward(tree, plan, {tile, region.face_ids}, images, scratch));
  });
  return spent;
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// The adjoint of alpha. Where A is not close to 1, the product over all other faces is the whole
// product times 1 + A + A^2 + ... This covers light pixels, whose product the forward pass stores,
// and the far faces of dark pixels. For the near faces of dark pixels, prefix and suffix products
// are kept. Nothing is ever divided by 1 - A.
// Lanes are faces, the loop runs over pixels.

#if defined(TILEGRAD_RASTER_SOFT_MASK_BACKWARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_BACKWARD_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_BACKWARD_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_BACKWARD_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <limits>
#include <numbers>

#include "raster/soft_mask/forward-inl.h"
#include "raster/soft_mask/gradient-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// The background pixels of a tile, except those whose alpha is so small that all faces may be
// dropped: the sum of A over all faces is at most about alpha.
HWY_INLINE TilePixels SoftPixelsOf(const SoftMaskPlan& plan, const SoftMaskRegion& tile,
                                   std::span<const float> alpha) {
  const std::int32_t* ids = tile.face_ids.data();
  const auto least = static_cast<float>(plan.stop_error);
  return TilePixels(
      plan, tile.rect,
      [&](std::size_t i) HWY_ATTR {
        const TileTag d;
        const TileIntTag di;
        const auto soft = hn::Gt(hn::LoadU(d, alpha.data() + i), hn::Set(d, least));
        return hn::And(hn::RebindMask(d, hn::Lt(hn::LoadU(di, ids + i), hn::Zero(di))), soft);
      },
      [&](std::size_t i) { return ids[i] < 0 && alpha[i] > least; });
}

// Backward through one tile, after FindNearGroups.
class TileBackward {
 public:
  TileBackward(const SoftTree& tree, const SoftMaskPlan& plan, const PixelRect& tile,
               const TilePixels& soft, const SoftMaskAdjoint& adjoint, SoftMaskScratch* scratch,
               AlignedVector<SoftFaceGradient>* out)
      : tree_(tree), plan_(plan), adjoint_(adjoint), scratch_(scratch), out_(out) {
    box_ = SetUpBlocks(
        plan, tile,
        [&](const SoftBlock& block, std::size_t b)
            HWY_ATTR { return TakePixels(block, soft.of(b), b); },
        scratch->blocks);
    // dz / d(pixel) has the unit, dA / dz has ln 2.
    scale_ = {static_cast<float>(plan.unit_x * std::numbers::ln2),
              static_cast<float>(plan.unit_y * std::numbers::ln2)};
  }

  void Run() {
    if (!AnyLive(scratch_->blocks)) return;
    nodes_ = FindSoftNodes(tree_, plan_, box_, scratch_);
    if (nodes_.count == 0) return;
    reach_ = GradientReachOf(plan_, nodes_.faces);
    for (std::size_t b = 0; b < kTileBlocks; ++b) {
      weak_[b] = scratch_->blocks[b].bits;
      scratch_->blocks[b].live = dark_[b];
    }
    std::size_t next = 0;
    Fill(&next);
    if (next == nodes_.count) {
      OneChunk();
    } else {
      ManyChunks();
    }
  }

 private:
  // Fills in the chunk that starts at a node, unless it is loaded already.
  void Fill(std::size_t* next) {
    if (*next != chunk_begin_) {
      chunk_begin_ = chunk_end_ = *next;
      FillChunk({tree_, std::span(scratch_->nodes).first(nodes_.count), box_, reach_.z,
                 kBackwardChunkFaces},
                &chunk_end_, &scratch_->chunk);
    }
    *next = chunk_end_;
  }
  std::size_t IndexOf(const SoftBlock& block, std::size_t i) const {
    return PixelIndex(plan_, block.x0 + static_cast<int>(i % kBlockSize),
                      block.y0 + static_cast<int>(i / kBlockSize));
  }

  // The pixels of block b among `soft` that have a gradient. Sets their push, 2 d_alpha times the
  // product over all faces: moving the nearest point towards the pixel lowers z. Dark pixels, with
  // unknown product, get theirs later.
  HWY_INLINE std::uint64_t TakePixels(const SoftBlock& block, std::uint64_t soft, std::size_t b) {
    std::uint64_t bits = 0;
    for (std::uint32_t rows = RowsOf(soft); rows != 0; rows &= rows - 1) {
      const int y = std::countr_zero(rows);
      const std::size_t to = static_cast<std::size_t>(y) * kBlockSize;
      bits |= TakeRow(PixelIndex(plan_, block.x0, block.y0 + y), to, soft >> to & 0xff, b);
    }
    return bits;
  }

  // The push of the pixels `row` of a row of block b; returns the bits of those that have one.
  HWY_INLINE std::uint64_t TakeRow(std::size_t from, std::size_t to, std::uint64_t row,
                                   std::size_t b) {
    const SoftBlock& block = scratch_->blocks[b];
    const bool known = !adjoint_.transmittance.empty();
    const float* products =
        known ? adjoint_.transmittance.data() + TransmittanceIndex(plan_, block) : nullptr;
    const float* d_alphas = adjoint_.d_alpha.data() + from;
    if (known && block.width == static_cast<int>(kBlockSize)) {
      return SetPushes(products + to, d_alphas, to, row, b);
    }
    float product[kBlockSize] = {}, d_alpha[kBlockSize] = {};
    ForPixels(row, [&](std::size_t x) {
      const std::size_t at = to / kBlockSize * static_cast<std::size_t>(block.width) + x;
      product[x] = known ? products[at] : TransmittanceOf(plan_, adjoint_.alpha[from + x]);
      d_alpha[x] = d_alphas[x];
    });
    return SetPushes(product, d_alpha, to, row, b);
  }

  // The same from the row's transmittance and d_alpha, kBlockSize of each.
  HWY_INLINE std::uint64_t SetPushes(const float* product, const float* d_alpha, std::size_t to,
                                     std::uint64_t row, std::size_t b) {
    const SoftTag d;
    const SoftVec zero = hn::Zero(d);
    std::uint64_t bits = 0, dark = 0;
    for (std::size_t x = 0; x < kBlockSize; x += hn::Lanes(d)) {
      const SoftVec p = hn::LoadU(d, product + x), g = hn::LoadU(d, d_alpha + x);
      hn::Store(hn::Mul(hn::Add(g, g), p), d, push_[b] + to + x);
      const SoftMask has_push = hn::And(hn::Ne(p, zero), hn::Ne(g, zero));
      bits |= std::uint64_t{BitsOf(d, has_push)} << x;
      dark |= std::uint64_t{BitsOf(d, hn::Lt(p, zero))} << x;
    }
    bits &= row;
    dark_[b] |= (bits & dark) << to;
    return bits << to;
  }

  // All faces fit in the chunk: lists the members of each block once.
  void OneChunk() {
    ClearSums();
    for (std::size_t b = 0; b < kTileBlocks; ++b) {
      if (weak_[b] == 0) continue;
      FindMembers(b);
      if (dark_[b] != 0) {
        StartProducts(b);
        MultiplyProducts(b);
        DarkGradients(b);
      }
      AddWeakGradients(b);
    }
    EmitSums();
  }

  void ManyChunks() {
    if (AnyLive(scratch_->blocks)) FindProducts();
    for (std::size_t b = 0; b < kTileBlocks; ++b) {
      if (dark_[b] != 0) DarkGradients(b);
    }
    for (std::size_t next = 0; next < nodes_.count;) {
      Fill(&next);
      ClearSums();
      for (std::size_t b = 0; b < kTileBlocks; ++b) {
        if (weak_[b] != 0) {
          FindMembers(b);
          AddWeakGradients(b);
        }
      }
      EmitSums();
    }
  }

  void FindMembers(std::size_t b) {
    const SoftBlock& block = scratch_->blocks[b];
    FindFeatures(scratch_->chunk, plan_, {block, block.bits, reach_, dark_[b] != 0},
                 &scratch_->lists);
  }

  // The products over all faces in dark pixels: near faces one by one, far ones in block.alpha.
  void FindProducts() {
    SoftBlock* blocks = scratch_->blocks;
    for (std::size_t b = 0; b < kTileBlocks; ++b) {
      if (dark_[b] != 0) StartProducts(b);
    }
    for (std::size_t next = 0; next < nodes_.count && AnyLive(blocks);) {
      Fill(&next);
      for (std::size_t b = 0; b < kTileBlocks; ++b) {
        if (blocks[b].live != 0) {
          FindMembers(b);
          MultiplyProducts(b);
        }
      }
    }
  }

  void StartProducts(std::size_t b) {
    ClearAlpha(&scratch_->blocks[b]);
    scratch_->near[b].clear();
    std::fill_n(near_product_[b], kBlockPixels, 1.0f);
  }

  void MultiplyProducts(std::size_t b) {
    SoftBlock& block = scratch_->blocks[b];
    PartialAlpha far(&block, scratch_);
    far.AddVertices();
    far.Merge();
    far.AddSegments();
    far.Merge();
    AppendNear(block, near_product_[b], &scratch_->near[b], scratch_);
    // The square: a face's gradient may be as large as the root of the product
    // (docs/numerics.md).
    const double stop = plan_.stop_error * plan_.stop_error;
    ForPixels(block.live, [&](std::size_t i) {
      if (ProductAt(b, i) <= stop) block.live &= ~(std::uint64_t{1} << i);
    });
  }

  double ProductAt(std::size_t b, std::size_t i) const {
    return (1 - scratch_->blocks[b].alpha[i]) * static_cast<double>(near_product_[b][i]);
  }

  // Gradients of the near faces in dark pixels, with the push from the product over the far ones;
  // then the push of the others, if they can matter.
  void DarkGradients(std::size_t b) {
    const SoftBlock& block = scratch_->blocks[b];
    const auto push = [&](std::size_t i, double product) {
      push_[b][i] = static_cast<float>(
          2 * static_cast<double>(adjoint_.d_alpha[IndexOf(block, i)]) * product);
    };
    ForPixels(dark_[b], [&](std::size_t i) { push(i, 1 - block.alpha[i]); });
    for (const SoftNearFaces& faces : scratch_->near[b]) {
      NotePairs(SoftTag(), faces.bits, &scratch_->work);
    }
    AppendNearGradients(block, scratch_->near[b], push_[b], scale_, out_);
    ForPixels(dark_[b], [&](std::size_t i) {
      push(i, ProductAt(b, i));
      if (ProductAt(b, i) <= plan_.stop_error) weak_[b] &= ~(std::uint64_t{1} << i);
    });
  }

  void AddWeakGradients(std::size_t b) {
    const WeakFaces faces{
        scratch_->blocks[b], scratch_->lists, push_[b], {scratch_->sums}, &scratch_->work};
    faces.Vertices(weak_[b]);
    faces.Segments(weak_[b]);
    faces.Boundaries(weak_[b] & ~dark_[b]);
  }

  // Gradients of the faces of the chunk.
  void ClearSums() {
    std::fill_n(scratch_->sums[0], kSumRow * scratch_->chunk.shorts.count, 0.0f);
    std::fill_n(scratch_->sums[kChunkRoom], kSumRow * scratch_->chunk.longs.count, 0.0f);
  }
  void EmitSums() {
    Emit(scratch_->chunk.shorts, 0);
    Emit(scratch_->chunk.longs, kChunkRoom);
  }

  void Emit(const SoftFaceArrays& faces, std::size_t slot) {
    const auto* sums = scratch_->sums + slot;
    AppendGradients(
        faces.face, faces.count, [&](std::size_t q, std::size_t i) { return sums[i] + 4 * q; },
        scale_, out_);
  }

  const SoftTree& tree_;
  const SoftMaskPlan& plan_;
  const SoftMaskAdjoint& adjoint_;
  SoftMaskScratch* scratch_;
  AlignedVector<SoftFaceGradient>* out_;
  SoftBox box_;
  SoftNodes nodes_;
  SoftReach reach_;
  std::size_t chunk_begin_ = std::numeric_limits<std::size_t>::max(), chunk_end_ = 0;
  PixelScale scale_;
  std::uint64_t dark_[kTileBlocks] = {};  // pixels whose product must be found
  std::uint64_t weak_[kTileBlocks] = {};  // pixels where weak faces matter
  alignas(64) float push_[kTileBlocks][kBlockPixels];
  alignas(64) float near_product_[kTileBlocks][kBlockPixels];
};

inline void SoftMaskBackwardTarget(const SoftTree& tree, const SoftMaskPlan& plan,
                                   const SoftMaskRegion& region, const SoftMaskAdjoint& adjoint,
                                   SoftMaskScratch* scratch, AlignedVector<SoftFaceGradient>* out) {
  FindNearGroups(tree, plan, region.rect, &scratch->groups);
  ForTiles(region.rect, [&](const PixelRect& tile) HWY_ATTR {
    const PixelRect next = NextTile(region.rect, tile);
    PrefetchTile(plan, next, region.face_ids.data());
    PrefetchTile(plan, next, adjoint.alpha.data());
    const TilePixels soft = SoftPixelsOf(plan, {tile, region.face_ids}, adjoint.alpha);
    if (!soft.none()) TileBackward(tree, plan, tile, soft, adjoint, scratch, out).Run();
  });
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

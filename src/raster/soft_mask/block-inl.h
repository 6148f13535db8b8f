// SPDX-License-Identifier: Apache-2.0
// The blocks of a tile: their background pixels and geometry.

#if defined(TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include "base/prefetch.h"
#include "base/simd_math-inl.h"
#include "raster/soft_mask/tree-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// The tree nodes that a tile visits. Lanes are nodes, groups.

namespace simd = tilegrad::HWY_NAMESPACE;

// The nodes that a tile visits.
struct SoftNodes {
  std::size_t count = 0;
  std::size_t faces = 0;  // in them
  double dropped = 0;     // bound on the sum of A of all other faces
};

// Bits of those of n boxes from i on that are within z of `box`.
HWY_INLINE std::uint32_t NearBits(SoftTag d, const SoftBoxes& boxes, std::size_t i, std::size_t n,
                                  const SoftBox& box, float z) {
  const SoftMask near = hn::Le(BoxDistance(d, boxes, i, box), hn::Set(d, z));
  return BitsOf(d, hn::And(near, hn::FirstN(d, n - i)));
}

// The box around the pixel centres of a rectangle.
inline SoftBox CentresOf(const PixelRect& rect, const SoftMaskPlan& plan) {
  return {static_cast<float>(rect.x0) + 0.5f, static_cast<float>(rect.y0) + 0.5f,
          static_cast<float>(rect.x1) - 0.5f, static_cast<float>(rect.y1) - 0.5f,
          static_cast<float>(plan.unit_x),    static_cast<float>(plan.unit_y)};
}

// The squared distance beyond which groups are dropped, plus a margin for its rounding.
inline float GroupLimit(const SoftMaskPlan& plan) {
  return static_cast<float>(plan.group_z * (1 + 0x1p-20));
}

// The groups near some pixel of a region. A box inside the region is no nearer to a group than the
// region is, in floating point too, so it includes every group that a tile would keep.
inline void FindNearGroups(const SoftTree& tree, const SoftMaskPlan& plan, const PixelRect& rect,
                           SoftNearGroups* near) {
  const SoftTag d;
  const SoftBox box = CentresOf(rect, plan);
  const std::size_t count = tree.groups.count;
  near->boxes.Resize(count);
  near->count = 0;
  if (near->group.size() < count) near->group.resize(count);
  for (std::size_t g = 0; g < count; g += hn::Lanes(d)) {
    std::uint32_t bits = NearBits(d, tree.groups, g, count, box, GroupLimit(plan));
    for (; bits != 0; bits &= bits - 1, ++near->count) {
      const std::size_t group = g + static_cast<std::size_t>(std::countr_zero(bits));
      near->group[near->count] = static_cast<std::int32_t>(group);
      for (std::size_t a = 0; a < SoftBoxes::kArrays; ++a) {
        near->boxes.array(a)[near->count] = tree.groups.array(a)[group];
      }
    }
  }
}

// Appends those nodes of a group that have faces and are nearer than z = `end` to the `count`
// found; returns the new count.
HWY_INLINE std::size_t AppendNodes(const SoftTree& tree, std::size_t group, const SoftBox& box,
                                   int end, std::size_t count, SoftNodesAt* found) {
  const SoftTag d;
  const SoftIntTag di;
  const SoftVec limit = hn::Set(d, static_cast<float>(end));
  const float* faces = tree.nodes.array(SoftBoxes::kFaces);
  for (std::size_t n = group * kGroupNodes; n < (group + 1) * kGroupNodes; n += hn::Lanes(d)) {
    const SoftVec z = BoxDistance(d, tree.nodes, n, box);
    const SoftMask full = hn::Gt(hn::Load(d, faces + n), hn::Zero(d));
    const Compactor compact(d, hn::And(full, hn::Lt(z, limit)));
    compact.Store(simd::CountFrom(di, static_cast<std::int32_t>(n)), found->node.data() + count);
    compact.Store(hn::ConvertTo(di, hn::Min(z, limit)), found->z.data() + count);
    count += compact.count();
  }
  return count;
}

// Collects the nodes of groups nearer than group_z in `found`, unless they are beyond z = `end`;
// returns their number. Adds a bound on the sum of A of the other groups to `dropped`, and all
// faces of these groups to `near_faces`.
HWY_INLINE std::size_t FindNodesOfGroups(const SoftTree& tree, const SoftMaskPlan& plan,
                                         const SoftBox& box, int end, SoftMaskScratch* scratch,
                                         double* dropped, double* near_faces) {
  const SoftTag d;
  const SoftNearGroups& groups = scratch->groups;
  SoftNodesAt& found = scratch->found;
  if (found.node.size() < tree.nodes.count) {
    found.node.resize(tree.nodes.count);
    found.z.resize(tree.nodes.count);
  }
  std::size_t count = 0;
  for (std::size_t g = 0; g < groups.count; g += hn::Lanes(d)) {
    std::uint32_t bits = NearBits(d, groups.boxes, g, groups.count, box, GroupLimit(plan));
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t i = g + static_cast<std::size_t>(std::countr_zero(bits));
      count = AppendNodes(tree, static_cast<std::size_t>(groups.group[i]), box, end, count, &found);
      *near_faces += static_cast<double>(groups.boxes.array(SoftBoxes::kFaces)[i]);
    }
  }
  *dropped += (static_cast<double>(tree.faces) - *near_faces) * plan.group_influence;
  return count;
}

// A histogram of nodes by the integer part of their z, for z less than `end`.
struct SoftHistogram {
  int end;
  double beyond;  // faces of the other nodes, from `end` on
  float faces[kEndZ + 1];
  std::int32_t nodes[kEndZ + 1];

  // `near_faces` is the total number of faces.
  HWY_INLINE SoftHistogram(const SoftBoxes& boxes, const SoftNodesAt& found, std::size_t count,
                           int end_z, double near_faces)
      : end(end_z), beyond(near_faces) {
    std::fill_n(faces, end, 0.0f);
    std::fill_n(nodes, end, 0);
    const float* in = boxes.array(SoftBoxes::kFaces);
    for (std::size_t i = 0; i < count; ++i) {
      const float more = in[found.node[i]];
      faces[found.z[i]] += more;
      ++nodes[found.z[i]];
      beyond -= static_cast<double>(more);
    }
  }
  // Drops the farthest nodes within `budget`; returns the first integer z dropped, and adds the
  // error of that to `dropped`.
  int DropFar(double budget, double* dropped) const {
    int from = end;
    double influence = std::ldexp(1.0, -end), cost = beyond * influence;
    while (from > 0) {
      influence *= 2;
      const double more = static_cast<double>(faces[from - 1]) * influence;
      if (cost + more > budget) break;
      cost += more;
      --from;
    }
    *dropped += cost;
    return from;
  }
};

// The nodes that a tile with background in `box` must visit, near ones first: a counting sort.
inline SoftNodes FindSoftNodes(const SoftTree& tree, const SoftMaskPlan& plan, const SoftBox& box,
                               SoftMaskScratch* scratch) {
  SoftNodes out;
  const int far = static_cast<int>(std::ceil(plan.group_z));
  double near_faces = 0;
  const std::size_t count =
      FindNodesOfGroups(tree, plan, box, far, scratch, &out.dropped, &near_faces);
  if (count == 0) {  // the usual case for tiles of pure background
    out.dropped += std::ldexp(near_faces, -far);
    return out;
  }
  const SoftNodesAt& found = scratch->found;
  // All faces at group_z together are within the budget.
  const SoftHistogram histogram(tree.nodes, found, count, far, near_faces);
  const int end = histogram.DropFar(plan.node_error / 2, &out.dropped);
  std::size_t begin[kEndZ + 1];
  for (int z = 0; z < end; ++z) {
    out.faces += static_cast<std::size_t>(histogram.faces[z]);
    begin[z] = out.count;
    out.count += static_cast<std::size_t>(histogram.nodes[z]);
  }
  begin[end] = out.count;  // dropped nodes go behind the others: branch-free
  if (scratch->nodes.size() < count) scratch->nodes.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    scratch->nodes[begin[std::min(found.z[i], end)]++] = found.node[i];
  }
  return out;
}

HWY_INLINE std::size_t PixelIndex(const SoftMaskPlan& plan, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(x);
}

// Offset of a block in SoftMaskImages::transmittance; its rows follow, `width` numbers each.
HWY_INLINE std::size_t TransmittanceIndex(const SoftMaskPlan& plan, const SoftBlock& block) {
  return static_cast<std::size_t>(block.y0) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(block.x0) * static_cast<std::size_t>(block.height);
}

// The tile after `tile` in `region`, in the order of ForTiles; empty after the last one.
HWY_INLINE PixelRect NextTile(const PixelRect& region, const PixelRect& tile) {
  const bool right = tile.x1 < region.x1;
  const int x = right ? tile.x1 : region.x0, y = right ? tile.y0 : tile.y1;
  return {x, y, HWY_MIN(x + kTileSize, region.x1), HWY_MIN(y + kTileSize, region.y1)};
}

// Prefetches a tile of an image, row by row.
template <class T>
HWY_INLINE void PrefetchTile(const SoftMaskPlan& plan, const PixelRect& tile, const T* image) {
  for (int y = tile.y0; y < tile.y1; ++y) {
    PrefetchLine(image + PixelIndex(plan, tile.x0, y));
    PrefetchLine(image + PixelIndex(plan, tile.x1 - 1, y));
  }
}

// Calls visit(pixel index in the image, in the block) for the first pixel of each row.
template <class Visit>
HWY_INLINE void ForRows(const SoftMaskPlan& plan, const SoftBlock& block, const Visit& visit) {
  for (int y = 0; y < block.height; ++y) {
    visit(PixelIndex(plan, block.x0, block.y0 + y), static_cast<std::size_t>(y) * kBlockSize);
  }
}

// Lanes are the pixels of a row of a tile.
using TileTag = hn::CappedTag<float, kTileSize>;
using TileIntTag = hn::RebindToSigned<TileTag>;

// A subset of a tile's pixels, as bits of its blocks.
class TilePixels {
 public:
  // The pixels where chosen(index in the image) is true, evaluated for whole vectors, or one(index
  // in the image) at the right edge of the image.
  template <class Chosen, class One>
  HWY_INLINE TilePixels(const SoftMaskPlan& plan, const PixelRect& rect, const Chosen& chosen,
                        const One& one) {
    const TileTag d;
    const auto width = static_cast<std::size_t>(rect.x1 - rect.x0);
    const auto row_at = [&](int y) HWY_ATTR {
      const std::size_t from = PixelIndex(plan, rect.x0, y);
      std::uint64_t row = 0;
      if (width == static_cast<std::size_t>(kTileSize)) {
        for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
          row |= std::uint64_t{BitsOf(d, chosen(from + x))} << x;
        }
      } else {
        for (std::size_t x = 0; x < width; ++x) row |= std::uint64_t{one(from + x)} << x;
      }
      return row;
    };
    for (std::size_t b = 0; b < kTileBlocks; b += 2) {
      std::uint64_t left = 0, right = 0;  // not in memory, as the array would be
      const int y0 = rect.y0 + static_cast<int>(b / 2 * kBlockSize);
      const int rows = HWY_MIN(rect.y1 - y0, static_cast<int>(kBlockSize));
      for (int y = 0; y < rows; ++y) {
        const std::uint64_t row = row_at(y0 + y);
        left |= (row & 0xff) << y * kBlockSize;
        right |= row >> kBlockSize << y * kBlockSize;
      }
      bits_[b] = left;
      bits_[b + 1] = right;
    }
  }

  bool none() const { return (bits_[0] | bits_[1] | bits_[2] | bits_[3]) == 0; }
  // Bits of block b.
  std::uint64_t of(std::size_t b) const { return bits_[b]; }
  // Bits of row y.
  std::uint32_t row(std::size_t y) const {
    const std::size_t b = y / kBlockSize * 2, from = y % kBlockSize * kBlockSize;
    return static_cast<std::uint32_t>((bits_[b] >> from & 0xff) | (bits_[b + 1] >> from & 0xff)
                                                                      << kBlockSize);
  }

 private:
  static_assert(kTileBlocks == 4);
  std::uint64_t bits_[kTileBlocks] = {};
};

// The background of a tile.
HWY_INLINE TilePixels BackgroundOf(const SoftMaskPlan& plan, const SoftMaskRegion& tile) {
  const std::int32_t* ids = tile.face_ids.data();
  return TilePixels(
      plan, tile.rect,
      [&](std::size_t i) HWY_ATTR {
        const TileIntTag di;
        return hn::RebindMask(TileTag(), hn::Lt(hn::LoadU(di, ids + i), hn::Zero(di)));
      },
      [&](std::size_t i) { return ids[i] < 0; });
}

// Bit x: some row has column x. Bit y: row y has a pixel.
HWY_INLINE std::uint32_t ColumnsOf(std::uint64_t bits) {
  for (const int shift : {32, 16, 8}) bits |= bits >> shift;
  return static_cast<std::uint32_t>(bits & 0xff);
}
HWY_INLINE std::uint32_t RowsOf(std::uint64_t bits) {
  for (const int shift : {4, 2, 1}) bits |= bits >> shift;
  // The lowest bit of each row to bits 56, 57, ... in turn.
  return static_cast<std::uint32_t>((bits & 0x0101010101010101u) * 0x0102040810204080u >> 56);
}

// The bounding box of the block's pixels to compute.
HWY_INLINE PixelRect BoxOf(const SoftBlock& block) {
  const std::uint32_t columns = ColumnsOf(block.bits), rows = RowsOf(block.bits);
  return {block.x0 + std::countr_zero(columns), block.y0 + std::countr_zero(rows),
          block.x0 + static_cast<int>(std::bit_width(columns)),
          block.y0 + static_cast<int>(std::bit_width(rows))};
}

// Everything that follows from block.bits, of which `rect` is the bounding box.
HWY_INLINE void PlaceBlock(const SoftMaskPlan& plan, const PixelRect& rect, SoftBlock* block) {
  const SoftBox& unit = block->box = CentresOf(rect, plan);
  block->live = block->bits;
  block->whole = 0;
  block->centre_x = 0.5f * static_cast<float>(rect.x0 + rect.x1);
  block->centre_y = 0.5f * static_cast<float>(rect.y0 + rect.y1);
  block->half_x = 0.5f * static_cast<float>(rect.x1 - 1 - rect.x0) * unit.unit_x;
  block->half_y = 0.5f * static_cast<float>(rect.y1 - 1 - rect.y0) * unit.unit_y;
  for (std::size_t i = 0; i < kBlockSize; ++i) {
    const float at = static_cast<float>(i) + 0.5f;
    block->x[i] = (static_cast<float>(block->x0) + at - block->centre_x) * unit.unit_x;
    block->y[i] = (static_cast<float>(block->y0) + at - block->centre_y) * unit.unit_y;
  }
}

// The blocks of a tile, and the box around all pixels to compute, given by bits_of(block, its
// number).
template <class Bits>
HWY_INLINE SoftBox SetUpBlocks(const SoftMaskPlan& plan, const PixelRect& rect, const Bits& bits_of,
                               SoftBlock* blocks) {
  PixelRect all{rect.x1, rect.y1, rect.x0, rect.y0};
  for (std::size_t b = 0; b < kTileBlocks; ++b) {
    SoftBlock& block = blocks[b];
    block.x0 = rect.x0 + static_cast<int>(b % 2 * kBlockSize);
    block.y0 = rect.y0 + static_cast<int>(b / 2 * kBlockSize);
    block.width = std::clamp(rect.x1 - block.x0, 0, static_cast<int>(kBlockSize));
    block.height = std::clamp(rect.y1 - block.y0, 0, static_cast<int>(kBlockSize));
    block.bits = block.width == 0 ? 0 : bits_of(block, b);
    block.live = 0;
    block.clear = true;
    if (block.bits == 0) continue;
    const PixelRect own = BoxOf(block);
    PlaceBlock(plan, own, &block);
    all = {std::min(all.x0, own.x0), std::min(all.y0, own.y0), std::max(all.x1, own.x1),
           std::max(all.y1, own.y1)};
  }
  return CentresOf(all, plan);
}

HWY_INLINE bool AnyLive(const SoftBlock* blocks) {
  return std::any_of(blocks, blocks + kTileBlocks, [](const SoftBlock& b) { return b.live != 0; });
}

// Fills the per-pixel arrays of a block. With vectors: compilers would choose rep stos, which is
// slow to start.
template <class T>
HWY_INLINE void FillPixels(T value, T* to) {
  const hn::CappedTag<T, kBlockSize> d;
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d))
    hn::Store(hn::Set(d, value), d, to + i);
}

// Alpha of a block over no faces: 0 for the pixels to compute.
HWY_INLINE void ClearAlpha(SoftBlock* block) {
  block->clear = false;
  FillPixels(0.0, block->alpha);
  FillPixels(1.0, block->product);
  FillPixels(1.0f, block->least);
  for (std::uint64_t others = ~block->bits; others != 0; others &= others - 1) {
    const int i = std::countr_zero(others);
    block->alpha[i] = 1;
    block->product[i] = 0;
  }
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

// SPDX-License-Identifier: Apache-2.0
// The soft mask on blocks of 8x8 pixels: lanes over the pixels of a cell, faces in the loop.

#if defined(TILEGRAD_RASTER_SOFT_MASK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "base/simd_math-inl.h"
#include "raster/soft_mask_setup.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace simd = tilegrad::HWY_NAMESPACE;

using D = hn::CappedTag<float, kCellPixels>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

// Where pixels lie relative to an edge; (side, beyond) is the way from the nearest point, in the
// frame (n, t) of the edge.
struct EdgeOffset {
  V side, beyond, along, z;
};

HWY_INLINE EdgeOffset OffsetOf(D d, const SoftBlockEdge& e, V x, V y) {
  const V tx = hn::Set(d, e.tx), ty = hn::Set(d, e.ty), zero = hn::Zero(d);
  EdgeOffset o;
  o.side = hn::NegMulAdd(ty, x, hn::MulAdd(tx, y, hn::Set(d, e.side)));
  const V step = hn::MulAdd(tx, x, hn::Mul(ty, y));
  o.along = hn::Add(step, hn::Set(d, e.along));
  const V past = hn::Add(step, hn::Set(d, e.past));
  o.beyond = hn::Add(hn::Max(past, zero), hn::Min(o.along, zero));
  o.z = hn::MulAdd(o.beyond, o.beyond, hn::Mul(o.side, o.side));
  return o;
}

HWY_INLINE V NearestZ(D d, const SoftBlockFace& f, V x, V y) {
  const V z01 = hn::Min(OffsetOf(d, f.edge[0], x, y).z, OffsetOf(d, f.edge[1], x, y).z);
  return hn::Min(z01, OffsetOf(d, f.edge[2], x, y).z);
}

struct Pixels {
  V x, y;
};
HWY_INLINE Pixels PixelsAt(D d, const SoftBlock& block, std::size_t pixel) {
  return {hn::Load(d, block.x + pixel), hn::Load(d, block.y + pixel)};
}

// Bit s: cell s may not drop the face.
HWY_INLINE std::uint32_t CellsNear(D d, const SoftBlock& block, const SoftBlockFace& face) {
  static_assert(kCells == kCellPixels);
  const std::size_t lanes = hn::Lanes(d);
  std::uint32_t near = 0;
  for (std::size_t s = 0; s < kCells; s += lanes) {
    const V z = NearestZ(d, face, hn::Load(d, block.cell_x + s), hn::Load(d, block.cell_y + s));
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, hn::Le(z, hn::Set(d, block.cell_reach)), bytes);
    near |= static_cast<std::uint32_t>(bytes[0]) << s;
  }
  return near;
}

// Calls visit(s) for every cell of `cells`.
template <class Visit>
HWY_INLINE void ForCells(std::uint32_t cells, const Visit& visit) {
  for (; cells != 0; cells &= cells - 1) {
    visit(static_cast<std::size_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(cells)));
  }
}

// a <- a + (1 - a) A for the pixels of cell s: keeps small alphas precise, which 1 - product would
// not.
HWY_INLINE void Accumulate(D d, const SoftBlock& block, const SoftBlockFace& face, std::size_t s,
                           float* alpha) {
  for (std::size_t i = s * kCellPixels; i < (s + 1) * kCellPixels; i += hn::Lanes(d)) {
    const Pixels p = PixelsAt(d, block, i);
    const V a = hn::Load(d, alpha + i);
    const V decay = simd::DecayOf(d, NearestZ(d, face, p.x, p.y)).exp;
    hn::Store(hn::MulAdd(hn::Sub(hn::Set(d, 1.0f), a), decay, a), d, alpha + i);
  }
}

// Merges a cell of `part` into `alpha` and zeroes it. Returns the least alpha.
inline double MergeCell(std::size_t s, float* part, double* alpha) {
  double lowest = 1;
  for (std::size_t i = s * kCellPixels; i < (s + 1) * kCellPixels; ++i) {
    alpha[i] += (1 - alpha[i]) * static_cast<double>(part[i]);
    part[i] = 0;
    lowest = std::min(lowest, alpha[i]);
  }
  return lowest;
}

inline void SoftMaskBlockTarget(const SoftBlock& block, SoftBlockAlpha* out) {
  const D d;
  alignas(64) float part[kBlockPixels];
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d)) hn::Store(hn::Zero(d), d, part + i);
  std::fill_n(out->looked, kCells, 0u);
  out->stopped = 0;
  for (std::size_t begin = 0; begin < block.count; begin += kMergeEvery) {
    const std::size_t end = std::min(begin + kMergeEvery, block.count);
    std::uint32_t touched = 0;
    for (std::size_t m = begin; m < end; ++m) {
      const SoftBlockFace& face = block.members[m];
      const std::uint32_t cells = CellsNear(d, block, face) & block.cells & ~out->stopped;
      touched |= cells;
      ForCells(cells, [&](std::size_t s) HWY_ATTR {
        Accumulate(d, block, face, s, part);
        ++out->looked[s];
      });
    }
    ForCells(touched, [&](std::size_t s) HWY_ATTR {
      const double lowest = MergeCell(s, part, out->alpha);
      if (end < block.count && 1 - lowest <= block.stop) out->stopped |= 1u << s;
    });
    if (out->stopped == block.cells) break;
  }
}

// Fills products and the cells of members, and returns how many members matter: behind them, every
// product is <= stop.
inline std::size_t ForwardProducts(const SoftBlock& block, const SoftBlockGradient& g,
                                   float* product) {
  const D d;
  for (int i = 0; i < kBlockPixels; ++i) product[i] = g.d_alpha[i] == 0 ? 0.0f : 1.0f;
  std::uint32_t live = block.cells;
  for (std::size_t m = 0; m < block.count; ++m) {
    if (m > 0 && m % kMergeEvery == 0) {
      ForCells(live, [&](std::size_t s) HWY_ATTR {
        const float* cell = product + s * kCellPixels;
        const float largest = *std::max_element(cell, cell + kCellPixels);
        if (static_cast<double>(largest) <= block.stop) live &= ~(1u << s);
      });
      if (live == 0) return m;
    }
    SoftBlockFace& face = block.members[m];
    face.cells = CellsNear(d, block, face) & live;
    ForCells(face.cells, [&](std::size_t s) HWY_ATTR {
      for (std::size_t i = s * kCellPixels; i < (s + 1) * kCellPixels; i += hn::Lanes(d)) {
        const Pixels p = PixelsAt(d, block, i);
        const V before = hn::Load(d, product + i);
        hn::Store(before, d, g.products + m * kBlockPixels + i);
        const V outside = simd::DecayOf(d, NearestZ(d, face, p.x, p.y)).one_minus;
        hn::Store(hn::Mul(before, outside), d, product + i);
      }
    });
  }
  return block.count;
}

// The nearest of a face's three edges, by lanes: offset in x, y; weight of the edge's second
// corner.
struct Nearest {
  V z, rx, ry, weight;
  M on1, on2;  // edge 1, edge 2; else edge 0
};

struct EdgeVector {
  V z, rx, ry, weight;
};
HWY_INLINE EdgeVector EdgeVectorOf(D d, const SoftBlockEdge& e, const Pixels& p) {
  const EdgeOffset o = OffsetOf(d, e, p.x, p.y);
  const V tx = hn::Set(d, e.tx), ty = hn::Set(d, e.ty);
  const V fraction = hn::Mul(o.along, hn::Set(d, e.inverse_length));
  return {o.z, hn::NegMulAdd(o.side, ty, hn::Mul(o.beyond, tx)),
          hn::MulAdd(o.side, tx, hn::Mul(o.beyond, ty)),
          hn::Min(hn::Max(fraction, hn::Zero(d)), hn::Set(d, 1.0f))};
}

HWY_INLINE Nearest NearestOf(D d, const SoftBlockFace& f, const Pixels& p) {
  const EdgeVector e0 = EdgeVectorOf(d, f.edge[0], p);
  const EdgeVector e1 = EdgeVectorOf(d, f.edge[1], p);
  const EdgeVector e2 = EdgeVectorOf(d, f.edge[2], p);
  const M second = hn::Lt(e1.z, e0.z);
  const V z01 = hn::Min(e0.z, e1.z);
  const M third = hn::Lt(e2.z, z01);
  const auto pick = [&](V a, V b, V c) {
    return hn::IfThenElse(third, c, hn::IfThenElse(second, b, a));
  };
  return {hn::Min(z01, e2.z),        pick(e0.rx, e1.rx, e2.rx),
          pick(e0.ry, e1.ry, e2.ry), pick(e0.weight, e1.weight, e2.weight),
          hn::AndNot(third, second), third};
}

// Sums of one face's corner gradients over the block.
struct CornerSums {
  V x[3], y[3];
};

// `push` is d_alpha dalpha/dz times -2: moving the nearest point along r lowers z.
HWY_INLINE void AddToCorners(D d, const Nearest& n, V push, CornerSums* sums) {
  const V zero = hn::Zero(d), gx = hn::Mul(push, n.rx), gy = hn::Mul(push, n.ry);
  const V b = n.weight, a = hn::Sub(hn::Set(d, 1.0f), b);
  const V weight[3] = {hn::IfThenElse(n.on2, b, hn::IfThenElse(n.on1, zero, a)),
                       hn::IfThenElse(n.on2, zero, hn::IfThenElse(n.on1, a, b)),
                       hn::IfThenElse(n.on2, a, hn::IfThenElse(n.on1, b, zero))};
  for (int k = 0; k < 3; ++k) {
    sums->x[k] = hn::MulAdd(weight[k], gx, sums->x[k]);
    sums->y[k] = hn::MulAdd(weight[k], gy, sums->y[k]);
  }
}

// Member m: `before` and `behind` are the products over the members on either side of it, so that
// nothing is divided by 1 - A. Updates `behind`.
inline void MemberGradient(const SoftBlock& block, const SoftBlockGradient& g, std::size_t m,
                           float* behind) {
  const D d;
  const SoftBlockFace& face = block.members[m];
  if (face.cells == 0) return;
  const V zero = hn::Zero(d), two = hn::Set(d, 2.0f);
  CornerSums sums{{zero, zero, zero}, {zero, zero, zero}};
  ForCells(face.cells, [&](std::size_t s) HWY_ATTR {
    for (std::size_t i = s * kCellPixels; i < (s + 1) * kCellPixels; i += hn::Lanes(d)) {
      const Nearest n = NearestOf(d, face, PixelsAt(d, block, i));
      const simd::Decay<V> decay = simd::DecayOf(d, n.z);
      const V before = hn::Load(d, g.products + m * kBlockPixels + i);
      const V after = hn::Load(d, behind + i);
      hn::Store(hn::Mul(after, decay.one_minus), d, behind + i);
      const V weighted = hn::Mul(hn::Mul(two, decay.exp), hn::Load(d, g.d_alpha + i));
      AddToCorners(d, n, hn::Mul(weighted, hn::Mul(before, after)), &sums);
    }
  });
  float* corners = g.d_corners + face.position;
  for (std::size_t k = 0; k < 3; ++k) {
    corners[k * g.stride] += hn::GetLane(hn::SumOfLanes(d, sums.x[k]));
    corners[(3 + k) * g.stride] += hn::GetLane(hn::SumOfLanes(d, sums.y[k]));
  }
}

inline void SoftMaskBlockBackwardTarget(const SoftBlock& block, const SoftBlockGradient& g) {
  alignas(64) float product[kBlockPixels];
  const std::size_t used = ForwardProducts(block, g, product);
  std::fill_n(product, kBlockPixels, 1.0f);
  for (std::size_t m = used; m-- > 0;) MemberGradient(block, g, m, product);
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

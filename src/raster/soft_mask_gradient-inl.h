// SPDX-License-Identifier: Apache-2.0
// Gradients of the members of a block. Lanes are faces, pixels are in the loop.

#if defined(TILEGRAD_RASTER_SOFT_MASK_GRADIENT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_GRADIENT_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_GRADIENT_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_GRADIENT_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "raster/soft_mask_members-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// From gradients per kernel unit to gradients per pixel.
struct PixelScale {
  float x, y;
};

HWY_INLINE void AppendGradient(std::int32_t face, const float (&x)[3], const float (&y)[3],
                               const PixelScale& scale, AlignedVector<SoftFaceGradient>* out) {
  const bool none = x[0] == 0 && x[1] == 0 && x[2] == 0 && y[0] == 0 && y[1] == 0 && y[2] == 0;
  if (none) return;
  out->push_back({face,
                  {x[0] * scale.x, x[1] * scale.x, x[2] * scale.x},
                  {y[0] * scale.y, y[1] * scale.y, y[2] * scale.y}});
}

// A / (1 - A) for A <= 15/16: A (1 + A) (1 + A^2) (1 + A^4) ..., until what is lacking is below u.
HWY_INLINE SoftVec Odds(SoftTag d, SoftVec a) {
  // The least power is far below u, and far from denormal numbers, which are slow.
  const SoftVec base = hn::Max(a, hn::Set(d, 0x1p-30f));
  SoftVec power = hn::Mul(base, base), odds = hn::MulAdd(a, a, a);
  const auto times = [&](int factors) HWY_ATTR {
    for (int i = 0; i < factors; ++i) {
      odds = hn::MulAdd(odds, power, odds), power = hn::Mul(power, power);
    }
  };
  times(2);  // A^8 is lacking, relatively
  if (!hn::AllTrue(d, hn::Le(a, hn::Set(d, 0.125f)))) times(5);
  return odds;
}

// The nearest of the faces' three edges: the way to the pixel, and the share of the edge's second
// corner.
struct Nearest {
  SoftVec z, way_x, way_y, second;
  SoftMask on1, on2;  // edge 1, edge 2; else edge 0
};

HWY_INLINE Nearest NearestOf(SoftTag d, const BoundaryMembers& faces, const SoftBlock& block,
                             std::size_t pixel) {
  SoftVec z[3], x[3], y[3], second[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const EdgeMembers& edge = faces.edge[k];
    const EdgeOffset o = edge.At(d, block, pixel);
    z[k] = SquaredLength(o), second[k] = hn::Mul(o.along, edge.inverse);
    x[k] = hn::NegMulAdd(o.side, edge.ty, hn::Mul(o.beyond, edge.tx));
    y[k] = hn::MulAdd(o.side, edge.tx, hn::Mul(o.beyond, edge.ty));
  }
  const SoftMask closer1 = hn::Lt(z[1], z[0]);
  const SoftVec z01 = hn::Min(z[0], z[1]);
  const SoftMask on2 = hn::Lt(z[2], z01);
  const auto pick = [&](const SoftVec(&v)[3]) HWY_ATTR {
    return hn::IfThenElse(on2, v[2], hn::IfThenElse(closer1, v[1], v[0]));
  };
  const SoftVec share = hn::Min(hn::Max(pick(second), hn::Zero(d)), hn::Set(d, 1.0f));
  return {hn::Min(z01, z[2]), pick(x), pick(y), share, hn::AndNot(on2, closer1), on2};
}

// Sums of corner gradients, by faces.
struct CornerSums {
  SoftVec x[3], y[3];

  HWY_INLINE explicit CornerSums(SoftTag d) {
    for (std::size_t k = 0; k < 3; ++k) x[k] = y[k] = hn::Zero(d);
  }
  HWY_INLINE void Add(SoftTag d, const Nearest& n, SoftVec push) {
    const SoftVec zero = hn::Zero(d), gx = hn::Mul(push, n.way_x), gy = hn::Mul(push, n.way_y);
    const SoftVec b = n.second, a = hn::Sub(hn::Set(d, 1.0f), b);
    const SoftVec share[3] = {hn::IfThenElse(n.on2, b, hn::IfThenElse(n.on1, zero, a)),
                              hn::IfThenElse(n.on2, zero, hn::IfThenElse(n.on1, a, b)),
                              hn::IfThenElse(n.on2, a, hn::IfThenElse(n.on1, b, zero))};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = hn::MulAdd(share[k], gx, x[k]), y[k] = hn::MulAdd(share[k], gy, y[k]);
    }
  }
};

// Gradients of the faces of a chunk, by corner and slot.
struct ChunkSums {
  float (&v)[6][2 * kChunkRoom];

  // Adds lanes to corner part + next of the members from m on.
  HWY_INLINE void Add(SoftTag d, const SoftList& list, std::size_t m, std::int32_t next,
                      SoftVec d_x, SoftVec d_y) const {
    alignas(64) float x[kSoftLanes], y[kSoftLanes];
    hn::Store(d_x, d, x), hn::Store(d_y, d, y);
    for (std::size_t i = 0; i < hn::Lanes(d) && m + i < list.count; ++i) {
      const std::int32_t corner = (list.part[m + i] + next) % 3, slot = list.slot[m + i];
      v[corner][slot] += x[i], v[3 + corner][slot] += y[i];
    }
  }
};

// Faces of a block of which A <= 15/16; push [kBlockPixels] is 2 d_alpha times the product over all
// faces.
struct WeakFaces {
  const SoftBlock& block;
  const float* push;
  ChunkSums sums;

  void Vertices(const SoftListOf<2>& list, std::uint64_t pixels) const {
    const SoftTag d;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const std::uint64_t bits = PixelsOf(d, list, m, pixels);
      if (bits == 0) continue;
      const VertexMembers members(d, list, m, block, bits);
      SoftVec d_x = hn::Zero(d), d_y = hn::Zero(d);
      ForPixels(bits, [&](std::size_t i) HWY_ATTR {
        const SoftVec w = hn::Mul(Odds(d, members.Influence(i)), hn::Set(d, push[i]));
        d_x = hn::MulAdd(w, members.columns.way[i % kBlockSize], d_x);
        d_y = hn::MulAdd(w, members.rows.way[i / kBlockSize], d_y);
      });
      sums.Add(d, list, m, 0, d_x, d_y);
    }
  }

  void Segments(const SoftListOf<SoftLists::kEdgeArrays>& list, std::uint64_t pixels) const {
    const SoftTag d;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const std::uint64_t bits = PixelsOf(d, list, m, pixels);
      if (bits == 0) continue;
      const EdgeMembers edge(d, list.v[0] + m, list.kRoom);
      // Of push along n and t, and of both times the share of the second corner.
      SoftVec side = hn::Zero(d), beyond = side, second_side = side, second_beyond = side;
      ForPixels(bits, [&](std::size_t i) HWY_ATTR {
        const EdgeOffset o = edge.At(d, block, i);
        const SoftVec odds = Odds(d, simd::HalvingOf(d, SquaredLength(o)).power);
        const SoftVec w = hn::Mul(odds, hn::Set(d, push[i]));
        const SoftVec second =
            hn::Min(hn::Max(hn::Mul(o.along, edge.inverse), hn::Zero(d)), hn::Set(d, 1.0f));
        const SoftVec s = hn::Mul(w, o.side), b = hn::Mul(w, o.beyond);
        side = hn::Add(side, s), beyond = hn::Add(beyond, b);
        second_side = hn::MulAdd(s, second, second_side);
        second_beyond = hn::MulAdd(b, second, second_beyond);
      });
      const auto add = [&](std::int32_t next, SoftVec n, SoftVec t) HWY_ATTR {
        sums.Add(d, list, m, next, hn::NegMulAdd(n, edge.ty, hn::Mul(t, edge.tx)),
                 hn::MulAdd(n, edge.tx, hn::Mul(t, edge.ty)));
      };
      add(0, hn::Sub(side, second_side), hn::Sub(beyond, second_beyond));
      add(1, second_side, second_beyond);
    }
  }

  void Boundaries(const SoftListOf<3 * SoftLists::kEdgeArrays>& list, std::uint64_t pixels) const {
    const SoftTag d;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const BoundaryMembers members(d, list.v[0] + m, list.kRoom);
      CornerSums corners(d);
      ForPixels(PixelsOf(d, list, m, pixels), [&](std::size_t i) HWY_ATTR {
        const Nearest n = NearestOf(d, members, block, i);
        const SoftVec odds = Odds(d, simd::HalvingOf(d, n.z).power);
        corners.Add(d, n, hn::Mul(odds, hn::Set(d, push[i])));
      });
      for (std::size_t k = 0; k < 3; ++k) {
        sums.Add(d, list, m, static_cast<std::int32_t>(k), corners.x[k], corners.y[k]);
      }
    }
  }
};

// The products of all lanes, and of all lanes but the own.
struct LaneProducts {
  SoftVec all, others;

  HWY_INLINE LaneProducts(SoftTag d, SoftVec v) {
    others = Neighbour(d, v), all = hn::Mul(v, others);
    const SoftVec pairs = NextPair(d, all);
    others = hn::Mul(others, pairs), all = hn::Mul(all, pairs);
    if constexpr (hn::MaxLanes(d) > 4) {
      const SoftVec quartets = NextQuartet(d, all);
      others = hn::Mul(others, quartets), all = hn::Mul(all, quartets);
    }
  }
};

// Appends the boundaries of `list`, which come from `chunk`, for the live pixels; `product` is that
// of all near faces.
inline void AppendNear(const SoftBlock& block, const SoftListOf<3 * SoftLists::kEdgeArrays>& list,
                       const SoftChunk& chunk, float* product, AlignedVector<SoftNearFaces>* near) {
  const SoftTag d;
  for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
    const std::uint64_t bits = PixelsOf(d, list, m, block.live);
    if (bits == 0) continue;
    SoftNearFaces& faces = near->emplace_back();
    faces.count = std::min(hn::Lanes(d), list.count - m), faces.bits = bits;
    for (std::size_t i = 0; i < faces.count; ++i) {
      const auto slot = static_cast<std::size_t>(list.slot[m + i]);
      faces.face[i] =
          slot < kChunkRoom ? chunk.shorts.face[slot] : chunk.longs.face[slot - kChunkRoom];
    }
    for (std::size_t a = 0; a < 3 * SoftLists::kEdgeArrays; ++a) {
      hn::Store(hn::Load(d, list.v[a] + m), d, faces.edge[a]);
    }
    const BoundaryMembers members(d, list.v[0] + m, list.kRoom);
    ForPixels(bits, [&](std::size_t i) HWY_ATTR {
      faces.before[i] = product[i];
      const SoftVec outside = simd::HalvingOf(d, members.Z(d, block, i)).one_minus;
      product[i] *= hn::GetLane(LaneProducts(d, outside).all);
    });
  }
}

// Appends the gradients of near faces; push [kBlockPixels] is 2 d_alpha times the product over the
// far ones.
inline void AppendNearGradients(const SoftBlock& block, std::span<const SoftNearFaces> near,
                                const float* push, const PixelScale& scale,
                                AlignedVector<SoftFaceGradient>* out) {
  const SoftTag d;
  alignas(64) float behind[kBlockPixels];
  std::fill_n(behind, kBlockPixels, 1.0f);
  for (std::size_t n = near.size(); n-- > 0;) {
    const SoftNearFaces& faces = near[n];
    const BoundaryMembers members(d, faces.edge[0], kSoftLanes);
    CornerSums corners(d);
    ForPixels(faces.bits, [&](std::size_t i) HWY_ATTR {
      const Nearest at = NearestOf(d, members, block, i);
      const auto a = simd::HalvingOf(d, at.z);
      const LaneProducts outside(d, a.one_minus);
      const SoftVec rest = hn::Set(d, push[i] * (faces.before[i] * behind[i]));
      corners.Add(d, at, hn::Mul(hn::Mul(a.power, rest), outside.others));
      behind[i] *= hn::GetLane(outside.all);
    });
    alignas(64) float sums[6][kSoftLanes];
    for (std::size_t k = 0; k < 3; ++k) {
      hn::Store(corners.x[k], d, sums[k]), hn::Store(corners.y[k], d, sums[3 + k]);
    }
    for (std::size_t i = 0; i < faces.count; ++i) {
      AppendGradient(faces.face[i], {sums[0][i], sums[1][i], sums[2][i]},
                     {sums[3][i], sums[4][i], sums[5][i]}, scale, out);
    }
  }
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

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

#include "raster/soft_mask/members-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

// From gradients per kernel unit to gradients per pixel.
struct PixelScale {
  float x, y;
};

// Appends the nonzero gradients of faces [count]: quad(0, i) and quad(1, i) are a row.
template <class Row>
HWY_INLINE void AppendGradients(const std::int32_t* faces, std::size_t count, const Row& quad,
                                const PixelScale& scale, AlignedVector<SoftFaceGradient>* out) {
  const QuadTag d;
  const hn::FixedTag<float, 2> d_last;
  HWY_ALIGN const float scales[4] = {scale.x, scale.y, scale.x, scale.y};
  const Quad to_pixels = hn::Load(d, scales);
  const std::size_t before = out->size();
  out->resize(before + count);
  SoftFaceGradient* to = out->data() + before;
  for (std::size_t i = 0; i < count; ++i) {
    const Quad first = hn::Load(d, quad(0, i)), last = hn::Load(d, quad(1, i));
    hn::StoreU(hn::Mul(first, to_pixels), d, to->d_corner[0]);
    hn::StoreU(hn::LowerHalf(d_last, hn::Mul(last, to_pixels)), d_last, to->d_corner[2]);
    to->face = faces[i];
    // Branch-free: a branch would be hard to predict.
    to += !hn::AllTrue(d, hn::Eq(hn::Or(first, last), hn::Zero(d)));
  }
  out->resize(static_cast<std::size_t>(to - out->data()));
}

// The odds A / (1 - A) of equation 6's derivative, as A (1 + A) (1 + A^2) (1 + A^4) ...: kFactors
// factors, which leaves a relative error of about u.
template <int kFactors>
HWY_INLINE SoftVec OddsSeries(SoftTag d, SoftVec a) {
  // 2^-30 squared is far below u, yet far from denormal numbers, which are slow.
  const SoftVec base = hn::Max(a, hn::Set(d, 0x1p-30f));
  SoftVec power = hn::Mul(base, base), odds = hn::MulAdd(a, a, a);
  for (int i = 1; i < kFactors; ++i) {
    odds = hn::MulAdd(odds, power, odds);
    power = hn::Mul(power, power);
  }
  return odds;
}
// For z >= kSmallZ, that is A <= kSmallInfluence: relative error A^8, at most 2^-24.
inline constexpr float kSmallZ = 3, kSmallInfluence = 0.125f;
HWY_INLINE SoftVec SmallOdds(SoftTag d, SoftVec a) { return OddsSeries<3>(d, a); }
// For z >= kMediumZ: relative error A^32, at most 2^-24.
inline constexpr float kMediumZ = 0.75f;
HWY_INLINE SoftVec MediumOdds(SoftTag d, SoftVec a) { return OddsSeries<5>(d, a); }
// For A <= 63/64: relative error A^1024.
HWY_INLINE SoftVec LargeOdds(SoftTag d, SoftVec a) { return OddsSeries<10>(d, a); }
HWY_INLINE SoftVec Odds(SoftTag d, SoftVec a) {
  const bool small = hn::AllTrue(d, hn::Le(a, hn::Set(d, kSmallInfluence)));
  return small ? SmallOdds(d, a) : LargeOdds(d, a);
}

// On the nearest of the faces' three edges: the offset to the pixel, and the weight of the edge's
// second corner.
struct Nearest {
  SoftVec offset_x, offset_y, second;
  SoftMask on1, on2;  // edge 1, edge 2; else edge 0
};

// For a pixel; *nearest_z: the squared distance.
HWY_INLINE Nearest NearestOf(SoftTag d, const BoundaryMembers& faces, const SoftBlock& block,
                             std::size_t pixel, SoftVec* nearest_z) {
  SoftVec z[3], x[3], y[3], second[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const EdgeMembers& edge = faces.edge[k];
    const EdgeOffset o = edge.At(d, block, pixel);
    z[k] = SquaredLength(o);
    second[k] = hn::Mul(o.along, edge.inverse);
    x[k] = hn::NegMulAdd(o.side, edge.ty, hn::Mul(o.beyond, edge.tx));
    y[k] = hn::MulAdd(o.side, edge.tx, hn::Mul(o.beyond, edge.ty));
  }
  const SoftMask closer1 = hn::Lt(z[1], z[0]);
  const SoftVec z01 = hn::Min(z[0], z[1]);
  const SoftMask on2 = hn::Lt(z[2], z01);
  const auto pick = [&](const SoftVec(&v)[3]) HWY_ATTR {
    return hn::IfThenElse(on2, v[2], hn::IfThenElse(closer1, v[1], v[0]));
  };
  const SoftVec share = hn::Min(pick(second), hn::Set(d, 1.0f));
  *nearest_z = hn::Min(z01, z[2]);
  return {pick(x), pick(y), share, hn::AndNot(on2, closer1), on2};
}

// The same for the pixels of a block.
class NearestOfPixels {
 public:
  HWY_INLINE void Store(SoftTag d, std::size_t i, const Nearest& n) {
    hn::Store(n.offset_x, d, v_[0][i]);
    hn::Store(n.offset_y, d, v_[1][i]);
    hn::Store(n.second, d, v_[2][i]);
    hn::Store(hn::VecFromMask(d, n.on1), d, v_[3][i]);
    hn::Store(hn::VecFromMask(d, n.on2), d, v_[4][i]);
  }
  HWY_INLINE Nearest At(SoftTag d, std::size_t i) const {
    const auto load = [&](std::size_t a) HWY_ATTR { return hn::Load(d, v_[a][i]); };
    return {load(0), load(1), load(2), hn::MaskFromVec(load(3)), hn::MaskFromVec(load(4))};
  }

 private:
  alignas(64) float v_[5][kBlockPixels][kSoftLanes];
};

// Offsets of a block's pixels from edges.
class OffsetsOfPixels {
 public:
  HWY_INLINE void Store(SoftTag d, std::size_t i, const EdgeOffset& o) {
    hn::Store(o.side, d, v_[0][i]);
    hn::Store(o.beyond, d, v_[1][i]);
    hn::Store(o.along, d, v_[2][i]);
  }
  HWY_INLINE EdgeOffset At(SoftTag d, std::size_t i) const {
    return {hn::Load(d, v_[0][i]), hn::Load(d, v_[1][i]), hn::Load(d, v_[2][i])};
  }

 private:
  alignas(64) float v_[3][kBlockPixels][kSoftLanes];
};

// Pixels in which all faces have z >= kSmallZ, or kMediumZ.
struct FarPixels {
  std::uint64_t small = 0, medium = 0;

  HWY_INLINE void Note(SoftTag d, std::size_t i, SoftVec z) {
    const auto beyond = [&](float least) HWY_ATTR {
      return std::uint64_t{hn::AllTrue(d, hn::Ge(z, hn::Set(d, least)))} << i;
    };
    small |= beyond(kSmallZ);
    medium |= beyond(kMediumZ);
  }
};

// Sums of corner gradients, by face.
struct CornerSums {
  SoftVec x[3], y[3];

  HWY_INLINE explicit CornerSums(SoftTag d) {
    for (std::size_t k = 0; k < 3; ++k) x[k] = y[k] = hn::Zero(d);
  }
  HWY_INLINE void Add(SoftTag d, const Nearest& n, SoftVec push) {
    const SoftVec zero = hn::Zero(d), gx = hn::Mul(push, n.offset_x),
                  gy = hn::Mul(push, n.offset_y);
    const SoftVec b = n.second, a = hn::Sub(hn::Set(d, 1.0f), b);
    const SoftVec share[3] = {hn::IfThenElse(n.on2, b, hn::IfThenElse(n.on1, zero, a)),
                              hn::IfThenElse(n.on2, zero, hn::IfThenElse(n.on1, a, b)),
                              hn::IfThenElse(n.on2, a, hn::IfThenElse(n.on1, b, zero))};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = hn::MulAdd(share[k], gx, x[k]);
      y[k] = hn::MulAdd(share[k], gy, y[k]);
    }
  }
};

// By pixel: first squared distances, then what they make of the push.
using Pushes = float[kBlockPixels][kSoftLanes];

// Sums over the pixels `bits`, with the push that push_all(far, pushes) computes for each. Separate
// loops, so that the work in flight is not one chain from the edges to the sums.
template <class PushAll>
HWY_INLINE CornerSums SumCorners(SoftTag d, const BoundaryMembers& faces, const SoftBlock& block,
                                 std::uint64_t bits, const PushAll& push_all) {
  NearestOfPixels nearest;
  alignas(64) Pushes pushes;
  FarPixels far;  // not in memory, unlike the others
  ForPixels(bits, [&](std::size_t i) HWY_ATTR {
    SoftVec z;
    nearest.Store(d, i, NearestOf(d, faces, block, i, &z));
    hn::Store(z, d, pushes[i]);
    far.Note(d, i, z);
  });
  push_all(far, pushes);
  CornerSums sums(d);
  ForPixels(bits,
            [&](std::size_t i) HWY_ATTR { sums.Add(d, nearest.At(d, i), hn::Load(d, pushes[i])); });
  return sums;
}

// The sums of each face as a row.
struct SumRows {
  alignas(64) float quads[2][4 * kSoftLanes];

  HWY_INLINE SumRows(SoftTag d, const CornerSums& c) {
    hn::StoreInterleaved4(c.x[0], c.y[0], c.x[1], c.y[1], d, quads[0]);
    hn::StoreInterleaved4(c.x[2], c.y[2], hn::Zero(d), hn::Zero(d), d, quads[1]);
  }
  HWY_INLINE const float* QuadAt(std::size_t q, std::size_t lane) const {
    return quads[q] + 4 * lane;
  }
};

// Gradients of the faces of a chunk, by slot.
struct ChunkSums {
  float (&v)[2 * kChunkRoom][kSumRow];

  // Adds the sums of the members from m on.
  HWY_INLINE void Add(SoftTag d, const SoftList& list, std::size_t m,
                      const CornerSums& corners) const {
    const QuadTag dq;
    const SumRows rows(d, corners);
    const std::size_t count = HWY_MIN(hn::Lanes(d), list.count - m);
    for (std::size_t i = 0; i < count; ++i) {
      float* to = v[list.slot[m + i]];
      for (std::size_t q = 0; q < 2; ++q, to += 4) {
        hn::Store(hn::Add(hn::Load(dq, to), hn::Load(dq, rows.QuadAt(q, i))), dq, to);
      }
    }
  }

  // Adds lanes to corner part + next of the members from m on.
  HWY_INLINE void Add(SoftTag d, const SoftList& list, std::size_t m, std::int32_t next,
                      SoftVec d_x, SoftVec d_y) const {
    alignas(64) float x[kSoftLanes], y[kSoftLanes];
    hn::Store(d_x, d, x);
    hn::Store(d_y, d, y);
    for (std::size_t i = 0; i < hn::Lanes(d) && m + i < list.count; ++i) {
      float* to = v[list.slot[m + i]] + 2 * ((list.part[m + i] + next) % 3);
      to[0] += x[i];
      to[1] += y[i];
    }
  }
};

// Faces of a block with A <= 63/64; push [kBlockPixels] is 2 d_alpha times the product over all
// faces.
struct WeakFaces {
  const SoftBlock& block;
  const SoftLists& lists;
  const float* push;
  ChunkSums sums;
  SoftWork* work;

  void Vertices(std::uint64_t pixels) const {
    const SoftTag d;
    const auto& list = lists.vertices;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const std::uint64_t bits = PixelsOf(d, lists, list, m, pixels);
      if (bits == 0) continue;
      NoteVertexPairs(d, bits, work);
      const VertexMembers<true> members(d, list, m, block, bits);
      const auto add = [&](const auto& odds) HWY_ATTR {
        SoftVec d_x = hn::Zero(d), d_y = hn::Zero(d);
        ForRowsOf(bits, [&](std::size_t row, std::uint64_t columns) HWY_ATTR {
          const SoftVec of_row = members.rows.power[row];
          const float* row_push = push + row * kBlockSize;
          SoftVec pushed = hn::Zero(d);
          ForPixels(columns, [&](std::size_t x) HWY_ATTR {
            const SoftVec influence = hn::Mul(members.columns.power[x], of_row);
            const SoftVec w = hn::Mul(odds(influence), hn::Set(d, row_push[x]));
            d_x = hn::MulAdd(w, members.columns.offsets[x], d_x);
            pushed = hn::Add(pushed, w);
          });
          d_y = hn::MulAdd(pushed, members.rows.offsets[row], d_y);
        });
        sums.Add(d, list, m, 0, d_x, d_y);
      };
      if (members.AllWithin(d, kSmallInfluence)) {
        add([&](SoftVec a) HWY_ATTR { return SmallOdds(d, a); });
      } else {
        add([&](SoftVec a) HWY_ATTR { return Odds(d, a); });
      }
    }
  }

  void Segments(std::uint64_t pixels) const {
    const SoftTag d;
    const auto& list = lists.segments;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const std::uint64_t bits = PixelsOf(d, lists, list, m, pixels);
      if (bits == 0) continue;
      NotePairs(d, bits, work);
      const EdgeMembers edge(d, list.v[0] + m, list.kRoom);
      OffsetsOfPixels offsets;
      alignas(64) Pushes pushes;
      FarPixels far;
      ForPixels(bits, [&](std::size_t i) HWY_ATTR {
        const EdgeOffset o = edge.At(d, block, i);
        const SoftVec z = SquaredLength(o);
        offsets.Store(d, i, o);
        hn::Store(z, d, pushes[i]);
        far.Note(d, i, z);
      });
      PushAll(bits, far, pushes);
      // Sums of the push along n and t, and of both times the weight of the second corner.
      SoftVec side = hn::Zero(d), beyond = side, second_side = side, second_beyond = side;
      ForPixels(bits, [&](std::size_t i) HWY_ATTR {
        const EdgeOffset o = offsets.At(d, i);
        const SoftVec w = hn::Load(d, pushes[i]);
        const SoftVec second = hn::Min(hn::Mul(o.along, edge.inverse), hn::Set(d, 1.0f));
        const SoftVec s = hn::Mul(w, o.side), b = hn::Mul(w, o.beyond);
        side = hn::Add(side, s);
        beyond = hn::Add(beyond, b);
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

  void Boundaries(std::uint64_t pixels) const {
    const SoftTag d;
    const auto& list = lists.boundaries;
    for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
      const BoundaryMembers members(d, list.v[0] + m, list.kRoom);
      const std::uint64_t bits = PixelsOf(d, lists, list, m, pixels);
      NotePairs(d, bits, work);
      const CornerSums corners = SumCorners(d, members, block, bits,
                                            [&](const FarPixels& far, Pushes& pushes)
                                                HWY_ATTR { PushAll(bits, far, pushes); });
      sums.Add(d, list, m, corners);
    }
  }

 private:
  // One loop per number of factors in the odds: which pixel needs which is hard to predict.
  HWY_INLINE void PushAll(std::uint64_t bits, const FarPixels& far, Pushes& pushes) const {
    const SoftTag d;
    const auto push_some = [&](std::uint64_t some, const auto& odds) HWY_ATTR {
      ForPixels(some, [&](std::size_t i) HWY_ATTR {
        const SoftVec a = simd::Exp2Neg(d, hn::Load(d, pushes[i])).power;
        hn::Store(hn::Mul(odds(a), hn::Set(d, push[i])), d, pushes[i]);
      });
    };
    push_some(bits & far.small, [&](SoftVec a) HWY_ATTR { return SmallOdds(d, a); });
    push_some(bits & far.medium & ~far.small, [&](SoftVec a) HWY_ATTR { return MediumOdds(d, a); });
    push_some(bits & ~far.medium, [&](SoftVec a) HWY_ATTR { return LargeOdds(d, a); });
  }
};

// Appends the boundaries of scratch->lists, whose chunk is scratch's, for the live pixels;
// `product` is that of all near faces.
inline void AppendNear(const SoftBlock& block, float* product, AlignedVector<SoftNearFaces>* near,
                       SoftMaskScratch* scratch) {
  const SoftTag d;
  const SoftLists& lists = scratch->lists;
  const SoftChunk& chunk = scratch->chunk;
  const auto& list = lists.boundaries;
  for (std::size_t m = 0; m < list.count; m += hn::Lanes(d)) {
    const std::uint64_t bits = PixelsOf(d, lists, list, m, block.live);
    if (bits == 0) continue;
    NotePairs(d, bits, &scratch->work);
    SoftNearFaces& faces = near->emplace_back();
    faces.count = std::min(hn::Lanes(d), list.count - m);
    faces.bits = bits;
    for (std::size_t i = 0; i < faces.count; ++i) {
      const auto slot = static_cast<std::size_t>(list.slot[m + i]);
      faces.face[i] =
          slot < kChunkRoom ? chunk.shorts.face[slot] : chunk.longs.face[slot - kChunkRoom];
    }
    for (std::size_t a = 0; a < 3 * SoftLists::kEdgeArrays; ++a) {
      hn::Store(hn::Load(d, list.v[a] + m), d, faces.edge[a]);
    }
    const BoundaryMembers members(d, list.v[0] + m, list.kRoom);
    alignas(64) float z[kBlockPixels][kSoftLanes];
    ForPixels(bits, [&](std::size_t i) HWY_ATTR { hn::Store(members.Z(d, block, i), d, z[i]); });
    ForPixels(bits, [&](std::size_t i) HWY_ATTR {
      faces.before[i] = product[i];
      const SoftVec outside = simd::Exp2Neg(d, hn::Load(d, z[i])).one_minus;
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
    const auto push_all = [&](const FarPixels&, Pushes& pushes) HWY_ATTR {
      ForPixels(faces.bits, [&](std::size_t i) HWY_ATTR {
        const auto a = simd::Exp2Neg(d, hn::Load(d, pushes[i]));
        const LaneProducts outside(d, a.one_minus);
        const SoftVec rest = hn::Set(d, push[i] * (faces.before[i] * behind[i]));
        behind[i] *= hn::GetLane(outside.all);
        hn::Store(hn::Mul(hn::Mul(a.power, rest), outside.others), d, pushes[i]);
      });
    };
    const CornerSums corners = SumCorners(d, members, block, faces.bits, push_all);
    const SumRows rows(d, corners);
    AppendGradients(
        faces.face, faces.count,
        [&](std::size_t q, std::size_t i) HWY_ATTR { return rows.QuadAt(q, i); }, scale, out);
  }
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard

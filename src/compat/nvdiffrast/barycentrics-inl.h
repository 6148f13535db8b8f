// SPDX-License-Identifier: Apache-2.0
// Vector body of barycentrics.h, forward. Lanes are adjacent pixels of a row. Every operation is
// that of barycentrics_ref.h, in its order and without fused multiply-adds: so are the bits.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "compat/nvdiffrast/barycentrics.h"
#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/quads-inl.h"
#include "raster/conventions.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using WideTag = HWY_CAPPED(double, 8);
using Wide = hn::Vec<WideTag>;
using WideMask = hn::Mask<WideTag>;
using NarrowTag = hn::Rebind<float, WideTag>;
using NarrowIntTag = hn::Rebind<std::int32_t, WideTag>;
inline constexpr std::size_t kMostLanes = 8;

// Four numbers of each of a vector of pixels.
struct NarrowQuads {
  hn::Vec<NarrowTag> c[4];

  HWY_INLINE explicit NarrowQuads(const float* from) {
    hn::LoadInterleaved4(NarrowTag(), from, c[0], c[1], c[2], c[3]);
  }
};

// The corners of the faces at adjacent pixels. Filled for all of them before the first are read: a
// load waits while its place was written by narrower stores that are not in the cache yet.
class CornerStage {
 public:
  static constexpr std::size_t kPixels = raster::kBinSize;

  // Sets the faces of a vector of pixels from number `at` on, some of which may have none: these
  // get the corners of the first face.
  HWY_INLINE void Put(const RasterizeInput<float>& input, std::size_t image, std::size_t at,
                      hn::Vec<NarrowIntTag> face) {
    const QuadTag quad;
    hn::Store(face, NarrowIntTag(), faces_ + at);
    for (std::size_t p = at; p < at + hn::Lanes(WideTag()); ++p) {
      const auto some = static_cast<std::size_t>(HWY_MAX(faces_[p], 0));
      for (std::size_t k = 0; k < 3; ++k) {
        const float* from = input.positions.at(image, input.faces[3 * some + k]);
        hn::Store(hn::LoadU(quad, from), quad, quads_[k] + 4 * p);
      }
    }
  }
  // A vector of pixels without faces.
  HWY_INLINE void PutNone(std::size_t at) {
    hn::Store(hn::Set(NarrowIntTag(), raster::kNoFace), NarrowIntTag(), faces_ + at);
  }
  HWY_INLINE const std::int32_t* faces(std::size_t at) const { return faces_ + at; }
  HWY_INLINE NarrowQuads Corners(std::size_t k, std::size_t at) const {
    return NarrowQuads(quads_[k] + 4 * at);
  }

 private:
  HWY_ALIGN float quads_[3][4 * kPixels];
  HWY_ALIGN std::int32_t faces_[kPixels];
};

HWY_INLINE hn::Mask<NarrowIntTag> HaveFaces(hn::Vec<NarrowIntTag> face) {
  return hn::Gt(face, hn::Set(NarrowIntTag(), raster::kNoFace));
}

// The corners at a vector of pixels.
struct CornerLanes {
  Wide x[3], y[3], z[3], w[3];

  HWY_INLINE CornerLanes(const CornerStage& stage, std::size_t at) {
    for (std::size_t k = 0; k < 3; ++k) {
      const NarrowQuads q = stage.Corners(k, at);
      x[k] = hn::PromoteTo(WideTag(), q.c[0]);
      y[k] = hn::PromoteTo(WideTag(), q.c[1]);
      z[k] = hn::PromoteTo(WideTag(), q.c[2]);
      w[k] = hn::PromoteTo(WideTag(), q.c[3]);
    }
  }
};

// a b - c d
HWY_INLINE Wide Minor(Wide a, Wide b, Wide c, Wide d) {
  return hn::Sub(hn::Mul(a, b), hn::Mul(c, d));
}

// barycentrics_ref::Products.
struct ProductLanes {
  Wide px[3], py[3];
  Wide a[3], ax[3], ay[3];
  Wide sum, sum_x, sum_y;

  HWY_INLINE ProductLanes(const CornerLanes& c, Wide x, Wide y) {
    for (int k = 0; k < 3; ++k) {
      px[k] = hn::Sub(c.x[k], hn::Mul(x, c.w[k]));
      py[k] = hn::Sub(c.y[k], hn::Mul(y, c.w[k]));
    }
    sum = sum_x = sum_y = hn::Zero(WideTag());
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      a[k] = Minor(px[i], py[j], py[i], px[j]);
      ax[k] = Minor(py[i], c.w[j], c.w[i], py[j]);
      ay[k] = Minor(c.w[i], px[j], px[i], c.w[j]);
      sum = hn::Add(sum, a[k]);
      sum_x = hn::Add(sum_x, ax[k]);
      sum_y = hn::Add(sum_y, ay[k]);
    }
  }
};

// Weights of corners 0 and 1, and their derivatives by x and y.
struct QuotientLanes {
  Wide inverse;
  Wide weight[2], slope[4];
  WideMask solid;

  HWY_INLINE QuotientLanes(const ProductLanes& p, const PixelSize& size) {
    const WideTag d;
    const Wide size_x = hn::Set(d, size.x), size_y = hn::Set(d, size.y);
    inverse = hn::Div(hn::Set(d, 1.0), p.sum);
    for (int k = 0; k < 2; ++k) {
      weight[k] = hn::Mul(p.a[k], inverse);
      const Wide by_x = hn::Sub(p.ax[k], hn::Mul(weight[k], p.sum_x));
      const Wide by_y = hn::Sub(p.ay[k], hn::Mul(weight[k], p.sum_y));
      slope[2 * k] = hn::Mul(hn::Mul(by_x, inverse), size_x);
      slope[2 * k + 1] = hn::Mul(hn::Mul(by_y, inverse), size_y);
    }
    solid = IsSolidLanes();
  }

 private:
  static HWY_INLINE Wide Square(Wide x, Wide y) { return hn::Add(hn::Mul(x, x), hn::Mul(y, y)); }
  // std::max: the first where one is NaN.
  static HWY_INLINE Wide Larger(Wide a, Wide b) { return hn::IfThenElse(hn::Lt(a, b), b, a); }
  HWY_INLINE WideMask IsSolidLanes() const {
    const Wide both = Square(hn::Add(slope[0], slope[2]), hn::Add(slope[1], slope[3]));
    const Wide steepest =
        Larger(Larger(Square(slope[0], slope[1]), Square(slope[2], slope[3])), both);
    return hn::Le(steepest, hn::Set(WideTag(), kSteepest * kSteepest));
  }
};

// std::clamp: NaN stays.
HWY_INLINE Wide Clamp(Wide v, Wide low, Wide high) {
  return hn::IfThenElse(hn::Lt(v, low), low, hn::IfThenElse(hn::Lt(high, v), high, v));
}

// The outputs at a vector of pixels.
struct BarycentricLanes {
  Wide u, v, depth, slope[4];

  HWY_INLINE BarycentricLanes(const CornerLanes& c, const QuotientLanes& q) {
    const WideTag d;
    const Wide third = hn::Set(d, 1.0 / 3.0), zero = hn::Zero(d), one = hn::Set(d, 1.0);
    u = hn::IfThenElse(q.solid, q.weight[0], third);
    v = hn::IfThenElse(q.solid, q.weight[1], third);
    for (int i = 0; i < 4; ++i) slope[i] = hn::IfThenElseZero(q.solid, q.slope[i]);
    const Wide last = hn::Sub(hn::Sub(one, u), v);
    const auto mean = [&](const Wide(&of)[3]) HWY_ATTR {
      return hn::Add(hn::Add(hn::Mul(u, of[0]), hn::Mul(v, of[1])), hn::Mul(last, of[2]));
    };
    depth = Clamp(hn::Div(mean(c.z), mean(c.w)), hn::Set(d, -1.0), one);
    u = Clamp(u, zero, one);
    v = Clamp(v, zero, hn::Sub(one, u));
  }
};

// Writes four numbers of each of the first `count` pixels of a vector; zeros where there is none.
HWY_INLINE void WriteQuads(const Wide (&wide)[4], hn::Mask<NarrowTag> some, std::size_t count,
                           float* to) {
  const NarrowTag d;
  HWY_ALIGN float numbers[4 * kMostLanes];
  const bool whole = count >= hn::Lanes(d);
  hn::Vec<NarrowTag> v[4];
  for (int i = 0; i < 4; ++i) v[i] = hn::DemoteTo(d, wide[i]);
  hn::StoreInterleaved4(hn::IfThenElseZero(some, v[0]), hn::IfThenElseZero(some, v[1]),
                        hn::IfThenElseZero(some, v[2]), hn::IfThenElseZero(some, v[3]), d,
                        whole ? to : numbers);
  if (!whole) std::memcpy(to, numbers, 4 * count * sizeof(float));
}

// Puts the faces of a row in place.
HWY_INLINE void StageRow(const RasterizeInput<float>& input, const BinRow& row,
                         CornerStage* stage) {
  const NarrowIntTag d;
  for (std::size_t i = 0; i < row.count; i += hn::Lanes(d)) {
    const auto seen = hn::LoadU(d, row.seen + i);
    const auto some = HaveFaces(seen);
    if (hn::AllFalse(d, some)) {
      stage->PutNone(i);
    } else {
      const auto face = hn::GatherIndex(d, row.source.data(), hn::Max(seen, hn::Zero(d)));
      stage->Put(input, row.image, i, hn::IfThenElse(some, face, seen));
    }
  }
}

void WriteRow(const RasterizeInput<float>& input, const PixelCentres& centres, const BinRow& row,
              const RasterizeOutput<float>& out) {
  const WideTag d;
  const NarrowTag narrow;
  const NarrowIntTag whole;
  const PixelSize size = SizeOf(input.grid);
  const Wide y = hn::Set(d, centres.y[static_cast<std::size_t>(row.y)]);
  const auto column = static_cast<std::size_t>(row.x);
  const std::size_t first = 4 * (input.grid.first(row.image, row.y) + column);
  float* rast = out.rast.data() + first;
  float* rast_db = out.rast_db.empty() ? nullptr : out.rast_db.data() + first;
  CornerStage stage;
  StageRow(input, row, &stage);
  for (std::size_t i = 0; i < row.count; i += hn::Lanes(d)) {
    const std::size_t count = HWY_MIN(hn::Lanes(d), row.count - i);
    const auto face = hn::Load(whole, stage.faces(i));
    const auto some = hn::RebindMask(narrow, HaveFaces(face));
    if (hn::AllFalse(narrow, some)) {
      WriteZeros(rast + 4 * i, rast + 4 * (i + count));
      if (rast_db != nullptr) WriteZeros(rast_db + 4 * i, rast_db + 4 * (i + count));
      continue;
    }
    const CornerLanes c(stage, i);
    const ProductLanes p(c, hn::LoadU(d, &centres.x[column + i]), y);
    const BarycentricLanes b(c, QuotientLanes(p, size));
    const Wide id = hn::PromoteTo(d, hn::Add(face, hn::Set(whole, 1)));
    WriteQuads({b.u, b.v, b.depth, id}, some, count, rast + 4 * i);
    if (rast_db != nullptr) WriteQuads(b.slope, some, count, rast_db + 4 * i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

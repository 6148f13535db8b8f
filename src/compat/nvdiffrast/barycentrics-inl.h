// SPDX-License-Identifier: Apache-2.0
// Vector body of barycentrics.h. Lanes are adjacent pixels of a row. Every operation is that of
// barycentrics_ref.h, in its order and without fused multiply-adds: so are the bits.
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
#include <span>

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

// The first `count` pixels of a vector, four numbers each; zeros after them.
class PixelQuads {
 public:
  HWY_INLINE const float* At(const float* from, std::size_t count) {
    if (HWY_LIKELY(count >= hn::Lanes(WideTag()))) return from;
    std::memset(padded_, 0, sizeof(padded_));
    std::memcpy(padded_, from, 4 * count * sizeof(float));
    return padded_;
  }

 private:
  HWY_ALIGN float padded_[4 * kMostLanes];
};

// Pixels without a face have the corners of the first one, which exists if any pixel has a face.
struct CornerLanes {
  Wide x[3], y[3], z[3], w[3];

  HWY_INLINE CornerLanes(const RasterizeInput<float>& input, std::size_t image,
                         const std::int32_t* faces) {
    const QuadTag quad;
    HWY_ALIGN float corners[3][4 * kMostLanes];
    for (std::size_t p = 0; p < hn::Lanes(WideTag()); ++p) {
      const auto face = static_cast<std::size_t>(HWY_MAX(faces[p], 0));
      for (std::size_t k = 0; k < 3; ++k) {
        const float* from = input.positions.at(image, input.faces[3 * face + k]);
        hn::Store(hn::LoadU(quad, from), quad, corners[k] + 4 * p);
      }
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const NarrowQuads q(corners[k]);
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
HWY_INLINE void WriteQuads(const hn::Vec<NarrowTag> (&v)[4], hn::Mask<NarrowTag> some,
                           std::size_t count, float* to) {
  const NarrowTag d;
  HWY_ALIGN float numbers[4 * kMostLanes];
  const bool whole = count >= hn::Lanes(d);
  hn::StoreInterleaved4(hn::IfThenElseZero(some, v[0]), hn::IfThenElseZero(some, v[1]),
                        hn::IfThenElseZero(some, v[2]), hn::IfThenElseZero(some, v[3]), d,
                        whole ? to : numbers);
  if (!whole) std::memcpy(to, numbers, 4 * count * sizeof(float));
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
  for (std::size_t i = 0; i < row.count; i += hn::Lanes(d)) {
    const std::size_t count = HWY_MIN(hn::Lanes(d), row.count - i);
    const auto face = hn::LoadU(whole, row.faces + i);
    const auto some = hn::RebindMask(narrow, hn::Gt(face, hn::Set(whole, raster::kNoFace)));
    if (hn::AllFalse(narrow, some)) {
      WriteZeros(rast + 4 * i, rast + 4 * (i + count));
      if (rast_db != nullptr) WriteZeros(rast_db + 4 * i, rast_db + 4 * (i + count));
      continue;
    }
    const CornerLanes c(input, row.image, row.faces + i);
    const ProductLanes p(c, hn::LoadU(d, &centres.x[column + i]), y);
    const BarycentricLanes b(c, QuotientLanes(p, size));
    const auto id = hn::ConvertTo(narrow, hn::Add(face, hn::Set(whole, 1)));
    WriteQuads(
        {hn::DemoteTo(narrow, b.u), hn::DemoteTo(narrow, b.v), hn::DemoteTo(narrow, b.depth), id},
        some, count, rast + 4 * i);
    if (rast_db == nullptr) continue;
    WriteQuads({hn::DemoteTo(narrow, b.slope[0]), hn::DemoteTo(narrow, b.slope[1]),
                hn::DemoteTo(narrow, b.slope[2]), hn::DemoteTo(narrow, b.slope[3])},
               some, count, rast_db + 4 * i);
  }
}

// The backward pass.

// Cotangents of a vector of pixels: BarycentricsCotangent.
struct CotangentLanes {
  Wide weight[2], slope[4];

  // rast, rast_db: of the pixels, or null.
  HWY_INLINE CotangentLanes(const float* rast, const float* rast_db) {
    const WideTag d;
    weight[0] = weight[1] = slope[0] = slope[1] = slope[2] = slope[3] = hn::Zero(d);
    if (rast != nullptr) {
      const NarrowQuads q(rast);
      for (int k = 0; k < 2; ++k) weight[k] = hn::PromoteTo(d, q.c[k]);
    }
    if (rast_db != nullptr) {
      const NarrowQuads q(rast_db);
      for (int i = 0; i < 4; ++i) slope[i] = hn::PromoteTo(d, q.c[i]);
    }
  }
};

// The cotangents of Products.
struct ProductPulls {
  Wide a[3], ax[3], ay[3];

  HWY_INLINE ProductPulls(const ProductLanes& p, const QuotientLanes& q, const PixelSize& size,
                          const CotangentLanes& of) {
    const WideTag d;
    const Wide size_x = hn::Set(d, size.x), size_y = hn::Set(d, size.y);
    Wide sum = hn::Zero(d), sum_x = hn::Zero(d), sum_y = hn::Zero(d);
    a[2] = ax[2] = ay[2] = hn::Zero(d);
    for (int k = 0; k < 2; ++k) {
      const Wide by_x = of.slope[2 * k], by_y = of.slope[2 * k + 1];
      ax[k] = hn::Mul(hn::Mul(by_x, size_x), q.inverse);
      ay[k] = hn::Mul(hn::Mul(by_y, size_y), q.inverse);
      const Wide rest = hn::Sub(of.weight[k], hn::Mul(ax[k], p.sum_x));
      a[k] = hn::Mul(hn::Sub(rest, hn::Mul(ay[k], p.sum_y)), q.inverse);
      sum_x = hn::Sub(sum_x, hn::Mul(ax[k], q.weight[k]));
      sum_y = hn::Sub(sum_y, hn::Mul(ay[k], q.weight[k]));
      const Wide slopes = hn::Add(hn::Mul(by_x, q.slope[2 * k]), hn::Mul(by_y, q.slope[2 * k + 1]));
      sum = hn::Sub(sum, hn::Add(hn::Mul(a[k], q.weight[k]), hn::Mul(slopes, q.inverse)));
    }
    for (int k = 0; k < 3; ++k) {
      a[k] = hn::Add(a[k], sum);
      ax[k] = hn::Add(ax[k], sum_x);
      ay[k] = hn::Add(ay[k], sum_y);
    }
  }
};

// What a vector of pixels adds to x, y and w of the corners of their faces: BarycentricsAdjoint;
// zeros where a face is not solid.
struct CornerPulls {
  static constexpr std::size_t kNumbers = 10;  // of a pixel: x, y, w of corners 0, 1, 2; 0
  Wide x[3], y[3], w[3];

  HWY_INLINE CornerPulls(const CornerLanes& c, const ProductLanes& p, const ProductPulls& of) {
    for (int k = 0; k < 3; ++k) x[k] = y[k] = w[k] = hn::Zero(WideTag());
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      x[i] = hn::Add(x[i], Minor(of.a[k], p.py[j], of.ay[k], c.w[j]));
      y[i] = hn::Add(y[i], Minor(of.ax[k], c.w[j], of.a[k], p.px[j]));
      x[j] = hn::Add(x[j], Minor(of.ay[k], c.w[i], of.a[k], p.py[i]));
      y[j] = hn::Add(y[j], Minor(of.a[k], p.px[i], of.ax[k], c.w[i]));
      w[i] = hn::Add(w[i], Minor(of.ay[k], p.px[j], of.ax[k], p.py[j]));
      w[j] = hn::Add(w[j], Minor(of.ax[k], p.py[i], of.ay[k], p.px[i]));
    }
  }
  HWY_INLINE void Finish(Wide at_x, Wide at_y, WideMask solid) {
    for (int k = 0; k < 3; ++k) {
      w[k] = hn::Sub(hn::Sub(w[k], hn::Mul(at_x, x[k])), hn::Mul(at_y, y[k]));
      for (Wide* v : {&x[k], &y[k], &w[k]}) *v = hn::IfThenElseZero(solid, *v);
    }
  }
  // Pairs of numbers: of all pixels the first pair, then the second, ...
  HWY_INLINE void Store(double* to) const {
    const WideTag d;
    const std::size_t pair = 2 * hn::Lanes(d);
    hn::StoreInterleaved2(x[0], y[0], d, to);
    hn::StoreInterleaved2(w[0], x[1], d, to + pair);
    hn::StoreInterleaved2(y[1], w[1], d, to + 2 * pair);
    hn::StoreInterleaved2(x[2], y[2], d, to + 3 * pair);
    hn::StoreInterleaved2(w[2], hn::Zero(d), d, to + 4 * pair);
  }
};

// Sums gradients on the current face before adding them to the face's corners.
class FaceSums {
 public:
  HWY_INLINE FaceSums(const RasterizeInput<float>& input, std::size_t image, BandSums::Adder* adder)
      : input_(input), image_(image), adder_(adder) {
    Clear();
  }
  // Adds pixel p of CornerPulls::Store, which shows `face`.
  HWY_INLINE void Add(std::int32_t face, const double* pulls, std::size_t p) {
    if (face != face_) {
      Flush();
      face_ = face;
    }
    const PairTag d;
    for (std::size_t i = 0; i < kPairs; ++i) {
      sum_[i] = hn::Add(sum_[i], hn::Load(d, pulls + 2 * (i * hn::Lanes(WideTag()) + p)));
    }
  }
  HWY_INLINE void Flush() {
    if (face_ == raster::kNoFace) return;
    HWY_ALIGN double sum[CornerPulls::kNumbers];
    for (std::size_t i = 0; i < kPairs; ++i) hn::Store(sum_[i], PairTag(), sum + 2 * i);
    const std::int32_t* v = &input_.faces[3 * static_cast<std::size_t>(face_)];
    for (std::size_t k = 0; k < 3; ++k) {
      double* to = adder_->Row(input_.positions.row(image_, v[k]));
      to[0] += sum[3 * k];
      to[1] += sum[3 * k + 1];
      to[3] += sum[3 * k + 2];  // z has no gradient
    }
    Clear();
  }

 private:
  using PairTag = hn::FixedTag<double, 2>;
  static constexpr std::size_t kPairs = CornerPulls::kNumbers / 2;

  HWY_INLINE void Clear() {
    for (auto& s : sum_) s = hn::Zero(PairTag());
  }

  const RasterizeInput<float>& input_;
  std::size_t image_;
  BandSums::Adder* adder_;
  std::int32_t face_ = raster::kNoFace;
  hn::Vec<PairTag> sum_[kPairs];
};

// The faces at a vector of pixels, and the first pixel whose face does not exist, as FaceOf and
// IsFaceId have it.
class FaceLanes {
 public:
  explicit FaceLanes(std::size_t count) : most_(static_cast<float>(count)) {}

  // Writes the faces; whether there is one. `first`: the index of the first pixel.
  HWY_INLINE bool Find(const float* rast, std::size_t first, std::int32_t* faces) {
    const NarrowTag d;
    const NarrowIntTag di;
    const auto id = NarrowQuads(rast).c[3];
    const auto number = hn::ConvertTo(di, id);
    const auto exists = hn::And(hn::Eq(hn::ConvertTo(d, number), id),
                                hn::And(hn::Ge(id, hn::Zero(d)), hn::Le(id, hn::Set(d, most_))));
    if (HWY_UNLIKELY(!hn::AllTrue(d, exists))) {
      const auto at = static_cast<std::size_t>(hn::FindFirstTrue(d, hn::Not(exists)));
      bad_ = HWY_MIN(bad_, first + at);
    }
    const auto one = hn::Set(di, 1);
    const auto face = hn::Sub(hn::IfThenElseZero(hn::RebindMask(di, exists), number), one);
    hn::Store(face, di, faces);
    return !hn::AllFalse(di, hn::Gt(face, hn::Set(di, raster::kNoFace)));
  }
  std::size_t bad() const { return bad_; }

 private:
  float most_;
  std::size_t bad_ = kNoPixel;
};

std::size_t PullBand(const RasterizeInput<float>& input, const PixelCentres& centres,
                     const RasterizeCotangents<float>& cotangents, const Band& band,
                     BandSums::Adder* adder) {
  const WideTag d;
  const PixelSize size = SizeOf(input.grid);
  FaceLanes numbers(input.faces.size() / 3);
  FaceSums sums(input, band.image, adder);
  PixelQuads rast, d_rast, d_rast_db;
  HWY_ALIGN std::int32_t faces[kMostLanes];
  HWY_ALIGN double pulls[CornerPulls::kNumbers * kMostLanes];
  for (int row = band.row_begin; row < band.row_end; ++row) {
    const Wide y = hn::Set(d, centres.y[static_cast<std::size_t>(row)]);
    for (std::size_t x = 0; x < input.grid.row(); x += hn::Lanes(d)) {
      const std::size_t first = input.grid.first(band.image, row) + x;
      const std::size_t count = HWY_MIN(hn::Lanes(d), input.grid.row() - x);
      const auto at = [&](std::span<const float> image, PixelQuads* quads) HWY_ATTR {
        return image.empty() ? nullptr : quads->At(image.data() + 4 * first, count);
      };
      if (!numbers.Find(at(cotangents.rast, &rast), first, faces)) continue;
      const CotangentLanes of(at(cotangents.d_rast, &d_rast), at(cotangents.d_rast_db, &d_rast_db));
      const CornerLanes corners(input, band.image, faces);
      const Wide column = hn::LoadU(d, &centres.x[x]);
      const ProductLanes products(corners, column, y);
      const QuotientLanes quotients(products, size);
      CornerPulls pull(corners, products, ProductPulls(products, quotients, size, of));
      pull.Finish(column, y, quotients.solid);
      pull.Store(pulls);
      for (std::size_t p = 0; p < hn::Lanes(d); ++p) {
        if (faces[p] != raster::kNoFace) sums.Add(faces[p], pulls, p);
      }
    }
  }
  sums.Flush();
  return numbers.bad();
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

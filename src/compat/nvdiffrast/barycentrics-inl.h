// SPDX-License-Identifier: Apache-2.0
// Vector body of barycentrics.h. Lanes are adjacent pixels of a row. Every operation is that of
// barycentrics_ref.h, in its order and without fused multiply-adds: so are the bits.

#include <hwy/highway.h>

#include <cstring>

#include "compat/nvdiffrast/barycentrics.h"
#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/quads-inl.h"
#include "raster/conventions.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {

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
    hn::Store(face, NarrowIntTag(), faces_ + at);
    for (std::size_t p = at; p < at + hn::Lanes(WideTag()); ++p) {
      const auto some = static_cast<std::size_t>(HWY_MAX(faces_[p], 0));
      for (std::size_t k = 0; k < 3; ++k) {
        const float* from = input.positions.at(image, input.faces[3 * some + k]);
        hn::Store(hn::LoadU(kQuad, from), kQuad, quads_[k] + 4 * p);
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

// Backward.

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

// The pixels of a band.
class BandPull {
 public:
  HWY_INLINE BandPull(const RasterizeInput<float>& input, const PixelCentres& centres,
                      const RasterizeCotangents<float>& cotangents)
      : input_(input), centres_(centres), cotangents_(cotangents), size_(SizeOf(input.grid)) {}

  // Puts the faces of pixels of a row, from column x on, in place. *bad: as of FaceIds.
  HWY_INLINE void Stage(std::size_t image, int row, std::size_t x, std::size_t* bad) {
    const NarrowTag d;
    const NarrowIntTag whole;
    const auto faces = static_cast<float>(input_.faces.size() / 3);
    const std::size_t lanes = hn::Lanes(WideTag());
    count_ = HWY_MIN(CornerStage::kPixels, input_.grid.row() - x);
    first_ = input_.grid.first(image, row) + x;
    for (std::size_t i = 0; i < count_; i += lanes) {
      const FaceIds ids(d, NarrowQuads(At(cotangents_.rast, i, &rast_)).c[3], faces);
      ids.Find(d, first_ + i, bad);
      const auto face = hn::Sub(ids.number, hn::Set(whole, 1));
      if (hn::AllFalse(whole, HaveFaces(face))) {
        stage_.PutNone(i);
      } else {
        stage_.Put(input_, image, i, face);
      }
    }
  }
  // Adds the gradients of these pixels.
  HWY_INLINE void Add(int row, std::size_t x, FaceSums* sums) {
    const WideTag d;
    const Wide y = hn::Set(d, centres_.y[static_cast<std::size_t>(row)]);
    HWY_ALIGN double pulls[CornerPulls::kNumbers * kMostLanes];
    for (std::size_t i = 0; i < count_; i += hn::Lanes(d)) {
      const std::int32_t* faces = stage_.faces(i);
      if (hn::AllFalse(NarrowIntTag(), HaveFaces(hn::Load(NarrowIntTag(), faces)))) continue;
      const CotangentLanes of(At(cotangents_.d_rast, i, &d_rast_),
                              At(cotangents_.d_rast_db, i, &d_rast_db_));
      const CornerLanes corners(stage_, i);
      const Wide column = hn::LoadU(d, &centres_.x[x + i]);
      const ProductLanes products(corners, column, y);
      const QuotientLanes quotients(products, size_);
      CornerPulls pull(corners, products, ProductPulls(products, quotients, size_, of));
      pull.Finish(column, y, quotients.solid);
      pull.Store(pulls);
      for (std::size_t p = 0; p < hn::Lanes(d); ++p) {
        if (faces[p] != raster::kNoFace) sums->Add(faces[p], pulls, p);
      }
    }
  }

 private:
  // Pixels from number i on of an image; null if there is none.
  HWY_INLINE const float* At(std::span<const float> image, std::size_t i, PixelQuads* quads) const {
    return image.empty() ? nullptr : quads->At(image.data() + 4 * (first_ + i), count_ - i);
  }

  const RasterizeInput<float>& input_;
  const PixelCentres& centres_;
  const RasterizeCotangents<float>& cotangents_;
  PixelSize size_;
  std::size_t first_ = 0, count_ = 0;
  CornerStage stage_;
  PixelQuads rast_, d_rast_, d_rast_db_;
};

std::size_t PullBand(const RasterizeInput<float>& input, const PixelCentres& centres,
                     const RasterizeCotangents<float>& cotangents, const Band& band,
                     BandSums::Adder* adder) {
  std::size_t bad = kNoPixel;
  FaceSums sums(input, band.image, adder);
  BandPull pull(input, centres, cotangents);
  for (int row = band.row_begin; row < band.row_end; ++row) {
    for (std::size_t x = 0; x < input.grid.row(); x += CornerStage::kPixels) {
      pull.Stage(band.image, row, x, &bad);
      pull.Add(row, x, &sums);
    }
  }
  sums.Flush();
  return bad;
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

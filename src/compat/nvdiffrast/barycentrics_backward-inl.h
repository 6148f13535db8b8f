// SPDX-License-Identifier: Apache-2.0
// Vector body of barycentrics.h, backward. Lanes are adjacent pixels of a row; the bits are those
// of barycentrics_ref.h, as in barycentrics-inl.h.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_BACKWARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_BACKWARD_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_BACKWARD_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_BARYCENTRICS_BACKWARD_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "compat/nvdiffrast/barycentrics-inl.h"
#include "compat/nvdiffrast/barycentrics.h"
#include "compat/nvdiffrast/barycentrics_ref.h"
#include "raster/conventions.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

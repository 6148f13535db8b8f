// SPDX-License-Identifier: Apache-2.0
// Vector body of interpolate.h. Lanes are the channels of a pixel (quads-inl.h). Nothing but sums
// depends on how many pixels in a row show one face: faces are small, and a branch that ends with
// each of them is guessed wrongly each time.
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "compat/nvdiffrast/band_sums.h"
#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/interpolate_band-inl.h"
#include "compat/nvdiffrast/quads-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// [begin, end) of the band, whose quads are all there if kWhole.
template <class K, bool kWhole>
HWY_INLINE void InterpolatePixels(const BandAtHand& band, std::size_t begin, std::size_t end,
                                  FaceNumbers* at, const InterpolateOutput<float>& out) {
  FaceNumbers numbers = *at;  // a copy stays in registers
  const std::size_t n = band.values.n, da = band.slopes;
  const std::size_t n_quads = K::Values(n), da_quads = K::Slopes(da);
  float *const to_first = out.out.data(), *const to_da_first = out.out_da.data();
  const float *const to_end = to_first + band.end * n, *const da_end = to_da_first + band.end * da;
  for (std::size_t p = begin; p < end; ++p) {
    float *to = to_first + p * n, *to_da = to_da_first + p * da;
    const std::int32_t face = numbers.At(p);
    if (face == 0) {
      const std::size_t count = numbers.EmptyUntil(p + 1, end) - p;
      WriteZeros(to, to + count * n);
      WriteZeros(to_da, to_da + count * da);
      p += count - 1;
      continue;
    }
    const std::int32_t* v = band.Vertices(face);
    const WeightQuads w(band.rast + 4 * p);
    CornerQuads q;
    for (std::size_t c = 0; c < n_quads; c += 4) {
      q = band.values.At(v, c);
      StoreQuad<kWhole>(hn::MulAdd(w.u, q.a, hn::MulAdd(w.v, q.b, hn::Mul(w.w, q.c))), to + c,
                        to_end);
    }
    if (da_quads == 0) continue;
    const SlopeQuads slopes(band.rast_db + 4 * p);
    for (std::size_t i = 0; i < da_quads; i += 4) {
      const EdgeQuads e = SlopeEdges<K>(band.sloped, v, i, q);
      StoreQuad<kWhole>(hn::MulAdd(slopes.u, e.u, hn::Mul(slopes.v, e.v)), to_da + i, da_end);
    }
  }
  *at = numbers;
}

// What is summed over the pixels of a face in a row, by quads: InterpolateSums of interpolate.h. In
// registers where their number is known.
template <class K>
class RunSums {
 public:
  HWY_INLINE RunSums(float* scratch, const BandAtHand& band, BandSums::Adder* faces)
      : memory_(scratch),
        values_((band.values.n + 3) / 4),
        slopes_((band.slopes + 3) / 4),
        faces_(faces) {
    Clear();
  }
  HWY_INLINE void AddValues(std::size_t c, const WeightQuads& w, Quad g) {
    const std::size_t row = K::kKnown ? 1 : values_, i = c / 4;
    Add(i, w.u, g);
    Add(row + i, w.v, g);
    Add(2 * row + i, w.w, g);
  }
  HWY_INLINE void AddSlopes(std::size_t number, const SlopeQuads& w, Quad g) {
    const std::size_t first = K::kKnown ? 3 : 3 * values_, i = number / 4;
    const std::size_t row = K::kKnown ? (K::kSums - 3) / 2 : slopes_;
    Add(first + i, w.u, g);
    Add(first + row + i, w.v, g);
  }
  // The next pixel shows a face, counted from 1; 0 at the end.
  HWY_INLINE void Begin(std::int32_t face) {
    if ((face == face_ && ++pixels_ < kMostRun) || faces_ == nullptr) return;
    if (face_ != 0) Flush();
    face_ = face;
    pixels_ = 0;
  }

 private:
  HWY_INLINE void Flush() {
    double* to = faces_->Row(static_cast<std::size_t>(face_) - 1);
    const std::size_t quads = K::kKnown ? K::kSums : 3 * values_ + 2 * slopes_;
    for (std::size_t i = 0; i < quads; ++i) AddWide(Sum(i), to + 4 * i);
    Clear();
  }
  static HWY_INLINE void AddWide(Quad v, double* to) {
    const hn::FixedTag<double, 2> d;
    const hn::Half<QuadTag> half;
    hn::StoreU(hn::Add(hn::LoadU(d, to), hn::PromoteTo(d, hn::LowerHalf(half, v))), d, to);
    to += 2;
    hn::StoreU(hn::Add(hn::LoadU(d, to), hn::PromoteTo(d, hn::UpperHalf(half, v))), d, to);
  }
  HWY_INLINE Quad Sum(std::size_t i) const {
    if constexpr (K::kKnown) return kept_[i];
    return hn::Load(QuadTag(), memory_ + 4 * i);
  }
  HWY_INLINE void Put(Quad v, std::size_t i) { hn::Store(v, QuadTag(), memory_ + 4 * i); }
  HWY_INLINE void Add(std::size_t i, Quad weight, Quad g) {
    if constexpr (K::kKnown) {
      kept_[i] = hn::MulAdd(weight, g, kept_[i]);
    } else {
      Put(hn::MulAdd(weight, g, Sum(i)), i);
    }
  }
  HWY_INLINE void Clear() {
    for (Quad& q : kept_) q = hn::Zero(QuadTag());
    for (std::size_t i = 0; i < 3 * values_ + 2 * slopes_ && !K::kKnown; ++i) {
      Put(hn::Zero(QuadTag()), i);
    }
  }

  float* memory_;
  std::size_t values_, slopes_;  // quads
  BandSums::Adder* faces_;       // null: not wanted
  std::int32_t face_ = 0;
  int pixels_ = 0;  // since the last flush, after the first one
  Quad kept_[K::kSums];
};

// (sum of u, sum of v, 0, 0)
HWY_INLINE Quad SumsOfTwo(Quad u, Quad v) {
  const QuadTag d;
  const Quad pairs = hn::Add(hn::InterleaveLower(d, u, v), hn::InterleaveUpper(d, u, v));
  const Quad sums = hn::Add(pairs, hn::ConcatUpperUpper(d, pairs, pairs));
  return hn::ConcatLowerLower(d, hn::Zero(d), sums);
}

// sum += g times e in the lanes that count.
HWY_INLINE void AddProducts(QuadMask counts, Quad g, const EdgeQuads& e, EdgeQuads* sum) {
  sum->u = hn::Add(sum->u, hn::IfThenElseZero(counts, hn::Mul(g, e.u)));
  sum->v = hn::Add(sum->v, hn::IfThenElseZero(counts, hn::Mul(g, e.v)));
}

// Where cotangents begin and end, and where those of rast go; null: not wanted.
struct PixelCotangents {
  const float *out, *da, *out_end, *da_end;
  float *rast, *rast_db;

  HWY_INLINE void Skip(std::size_t begin, std::size_t end) const {
    for (float* to : {rast, rast_db}) {
      if (to != nullptr) WriteZeros(to + 4 * begin, to + 4 * end);
    }
  }
};

template <class K, bool kWhole>
HWY_INLINE void PullPixels(const BandAtHand& band, std::size_t begin, std::size_t end,
                           FaceNumbers* at, const PixelCotangents& cotangents, RunSums<K>* run) {
  FaceNumbers numbers = *at;  // copies stay in registers
  RunSums<K> sums = *run;
  const PixelCotangents d = cotangents;
  const QuadTag tag;
  const Quad zero = hn::Zero(tag);
  const std::size_t n = band.values.n, da = band.slopes;
  for (std::size_t p = begin; p < end; ++p) {
    const std::int32_t face = numbers.At(p);
    if (face == 0) {
      const std::size_t first = p;
      p = numbers.EmptyUntil(p + 1, end) - 1;
      d.Skip(first, p + 1);
      continue;
    }
    sums.Begin(face);
    const std::int32_t* v = band.Vertices(face);
    const WeightQuads w(band.rast + 4 * p);
    CornerQuads q;
    EdgeQuads pull(zero, zero), slope_pull(zero, zero);
    for (std::size_t c = 0; c < K::Values(n); c += 4) {
      q = band.values.At(v, c);
      const Quad g = LoadQuad<kWhole>(d.out + p * n + c, d.out_end);
      AddProducts(LanesBelow(c, n), g, EdgeQuads(q), &pull);
      sums.AddValues(c, w, g);
    }
    for (std::size_t i = 0; i < K::Slopes(da); i += 4) {
      const Quad g = LoadQuad<kWhole>(d.da + p * da + i, d.da_end);
      AddProducts(LanesBelow(i, da), g, SlopeEdges<K>(band.sloped, v, i, q), &slope_pull);
      sums.AddSlopes(i, SlopeQuads(band.rast_db + 4 * p), g);
    }
    if (d.rast != nullptr) hn::StoreU(SumsOfTwo(pull.u, pull.v), tag, d.rast + 4 * p);
    if (d.rast_db == nullptr) continue;
    hn::StoreU(hn::Add(hn::ConcatLowerLower(tag, slope_pull.v, slope_pull.u),
                       hn::ConcatUpperUpper(tag, slope_pull.v, slope_pull.u)),
               tag, d.rast_db + 4 * p);
  }
  *at = numbers;
  *run = sums;
}

// Calls work.operator()<Known>().
template <class Work>
HWY_INLINE void WithKnown(const BandAtHand& band, const Work& work) {
  const bool shared = band.slopes == 0 || band.sloped.base == band.values.base;
  if (band.values.n > 4 || !shared) return work.template operator()<Known<false, 0>>();
  if (band.slopes == 0) return work.template operator()<Known<true, 0>>();
  if (band.slopes <= 4) return work.template operator()<Known<true, 1>>();
  return work.template operator()<Known<true, 2>>();
}

// Both return the first pixel of the band that names a face that does not exist, or kNoPixel.
std::size_t InterpolateBand(const InterpolateTask& task, const InterpolateOutput<float>& out) {
  const BandAtHand band(task);
  FaceNumbers numbers(band);
  WithKnown(band, [&]<class K>() HWY_ATTR {
    InterpolatePixels<K, true>(band, band.begin, band.whole(), &numbers, out);
    InterpolatePixels<K, false>(band, band.whole(), band.end, &numbers, out);
  });
  return numbers.bad();
}

// faces: sums of faces [InterpolateSums]; null where attributes have no gradient. `scratch`: as
// much.
std::size_t InterpolateBandBackward(const InterpolateTask& task,
                                    const InterpolateCotangents<float>& d, float* scratch,
                                    BandSums::Adder* faces,
                                    const InterpolateGradients<float>& out) {
  const BandAtHand band(task);
  FaceNumbers numbers(band);
  const PixelCotangents at{d.d_out.data(),
                           d.d_out_da.data(),
                           d.d_out.data() + d.d_out.size(),
                           d.d_out_da.data() + d.d_out_da.size(),
                           out.d_rast.data(),
                           out.d_rast_db.data()};
  WithKnown(band, [&]<class K>() HWY_ATTR {
    RunSums<K> sums(scratch, band, faces);
    PullPixels<K, true>(band, band.begin, band.whole(), &numbers, at, &sums);
    PullPixels<K, false>(band, band.whole(), band.end, &numbers, at, &sums);
    sums.Begin(0);
  });
  return numbers.bad();
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of interpolate.h. Lanes are the channels of a pixel (quads-inl.h). Only sums depend
// on how many adjacent pixels show the same face: faces are small, and a branch at the end of each
// would be mispredicted every time.

#include <hwy/highway.h>

#include <bit>

#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/quads-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {

// Inputs of a band's pixels: their faces, weights and corner attributes; lanes are channels
// (quads-inl.h).

// The corners of a face, four channels from some channel on; unspecified beyond the last one.
struct CornerQuads {
  Quad a, b, c;
};

// Differences of corners 0 and 1 from corner 2.
struct EdgeQuads {
  Quad u, v;

  HWY_INLINE EdgeQuads(Quad edge_u, Quad edge_v) : u(edge_u), v(edge_v) {}
  HWY_INLINE explicit EdgeQuads(const CornerQuads& q)
      : u(hn::Sub(q.a, q.c)), v(hn::Sub(q.b, q.c)) {}
  // For numbers 0 to 3 and 4 to 7 of (dA/dX, dA/dY) of the four attributes.
  HWY_INLINE EdgeQuads Twice(std::size_t half) const {
    return half == 0
               ? EdgeQuads(hn::InterleaveLower(kQuad, u, u), hn::InterleaveLower(kQuad, v, v))
               : EdgeQuads(hn::InterleaveUpper(kQuad, u, u), hn::InterleaveUpper(kQuad, v, v));
  }
};

// Rows of attributes of an image, of `n` numbers each.
struct AttributeRows {
  const float *base, *end;
  std::size_t stride, n;
  std::int32_t whole;  // vertices below this index can load four numbers from any of theirs

  HWY_INLINE AttributeRows(const VertexRows<float>& rows, std::size_t image, std::size_t count)
      : base(rows.at(image, 0)),
        end(rows.values.data() + rows.values.size()),
        stride(rows.channels),
        n(count) {
    const auto after = static_cast<std::size_t>(end - base);
    const std::size_t most = after < n + 3 || stride == 0 ? 0 : (after - n - 3) / stride + 1;
    whole = static_cast<std::int32_t>(HWY_MIN(rows.vertices, most));
  }
  HWY_INLINE const float* Row(std::int32_t vertex) const {
    return base + static_cast<std::size_t>(vertex) * stride;
  }
  HWY_INLINE CornerQuads At(const std::int32_t* v, std::size_t c) const {
    const float *a = Row(v[0]) + c, *b = Row(v[1]) + c, *last = Row(v[2]) + c;
    if (HWY_UNLIKELY(HWY_MAX(HWY_MAX(v[0], v[1]), v[2]) >= whole)) {
      return {LoadQuad(a, end), LoadQuad(b, end), LoadQuad(last, end)};
    }
    return {hn::LoadU(kQuad, a), hn::LoadU(kQuad, b), hn::LoadU(kQuad, last)};
  }
};

// Whether the number of quads per row is known at compile time. Known: attributes with derivatives
// are the first ones of those interpolated, and in the same quad.
template <bool kIsKnown, std::size_t kSlopes>
struct Known {
  static constexpr bool kKnown = kIsKnown;
  static constexpr std::size_t kSums = kIsKnown ? 3 + 2 * kSlopes : 1;  // quads
  static HWY_INLINE std::size_t Values(std::size_t n) { return kIsKnown ? 4 : n; }
  static HWY_INLINE std::size_t Slopes(std::size_t n) { return kIsKnown ? 4 * kSlopes : n; }
};

// The pixels of a band and their inputs.
struct BandAtHand {
  const float *rast, *rast_db;
  const std::int32_t* faces;
  float face_count;
  std::size_t begin, end;
  AttributeRows values, sloped;
  std::size_t slopes;  // 2 D

  HWY_INLINE explicit BandAtHand(const InterpolateTask& task)
      : rast(task.input.rast.data()),
        rast_db(task.input.rast_db.data()),
        faces(task.input.faces.data()),
        face_count(static_cast<float>(task.input.faces.size() / 3)),
        begin(task.input.grid.first(task.band.image, task.band.row_begin)),
        end(task.input.grid.first(task.band.image, task.band.row_end)),
        values(task.input.attributes, task.band.image, task.input.attributes.channels),
        sloped(task.sloped, task.band.image, task.input.diff_attrs.size()),
        slopes(2 * sloped.n) {}

  // Start of the last pixels, whose quads may reach beyond arrays.
  HWY_INLINE std::size_t whole() const { return end - HWY_MIN(end - begin, std::size_t{3}); }
  HWY_INLINE const std::int32_t* Vertices(std::int32_t face) const {
    return faces + 3 * static_cast<std::ptrdiff_t>(face) - 3;
  }
};

// The faces at pixels, counted from 1, 0 for none, and the first pixel with a face that does not
// exist.
class FaceNumbers {
 public:
  HWY_INLINE explicit FaceNumbers(const BandAtHand& band)
      : rast_(band.rast), most_(std::bit_cast<std::uint32_t>(band.face_count)) {}

  HWY_INLINE std::int32_t At(std::size_t pixel) {
    const float id = rast_[4 * pixel + 3];
    // For floats >= 0 the bits have the order of the values.
    if (HWY_LIKELY(std::bit_cast<std::uint32_t>(id) <= most_)) {
      const auto face = static_cast<std::int32_t>(id);
      if (HWY_LIKELY(static_cast<float>(face) == id)) return face;
    }
    if (id != 0) bad_ = HWY_MIN(bad_, pixel);
    return 0;
  }
  // End of the background pixels that start at `pixel`.
  HWY_INLINE std::size_t EmptyUntil(std::size_t pixel, std::size_t end) const {
    while (pixel < end && rast_[4 * pixel + 3] == 0) ++pixel;
    return pixel;
  }
  HWY_INLINE std::size_t bad() const { return bad_; }

 private:
  const float* rast_;
  std::uint32_t most_;
  std::size_t bad_ = kNoPixel;
};

// u, v and 1 - u - v of a pixel.
struct WeightQuads {
  Quad u, v, w;

  HWY_INLINE explicit WeightQuads(const float* rast) {
    u = hn::Set(kQuad, rast[0]);
    v = hn::Set(kQuad, rast[1]);
    w = hn::Sub(hn::Sub(hn::Set(kQuad, 1.0f), u), v);
  }
};

// (x, y, x, y) of the derivatives of u and of v.
struct SlopeQuads {
  Quad u, v;

  HWY_INLINE explicit SlopeQuads(const float* rast_db) {
    const Quad db = hn::LoadU(kQuad, rast_db);
    u = hn::ConcatLowerLower(kQuad, db, db);
    v = hn::ConcatUpperUpper(kQuad, db, db);
  }
};

// The edge differences from which numbers i to i + 3 of out_da follow; `q`: corners from the first
// attribute on.
template <class K>
HWY_INLINE EdgeQuads SlopeEdges(const AttributeRows& sloped, const std::int32_t* v, std::size_t i,
                                const CornerQuads& q) {
  return EdgeQuads(K::kKnown ? q : sloped.At(v, i / 8 * 4)).Twice(i % 8 / 4);
}

// Pixels [begin, end) of the band; with kWhole, all their quads are inside the arrays.
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

// Sums over the pixels of a face in a row, by quads: InterpolateSums of interpolate.h. In registers
// if their number is known.
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
  // Call before each pixel with its face, counted from 1; 0 at the end.
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
    return hn::Load(kQuad, memory_ + 4 * i);
  }
  HWY_INLINE void Put(Quad v, std::size_t i) { hn::Store(v, kQuad, memory_ + 4 * i); }
  HWY_INLINE void Add(std::size_t i, Quad weight, Quad g) {
    if constexpr (K::kKnown) {
      kept_[i] = hn::MulAdd(weight, g, kept_[i]);
    } else {
      Put(hn::MulAdd(weight, g, Sum(i)), i);
    }
  }
  HWY_INLINE void Clear() {
    for (Quad& q : kept_) q = hn::Zero(kQuad);
    for (std::size_t i = 0; i < 3 * values_ + 2 * slopes_ && !K::kKnown; ++i) {
      Put(hn::Zero(kQuad), i);
    }
  }

  float* memory_;
  std::size_t values_, slopes_;  // quads
  BandSums::Adder* faces_;       // null: not requested
  std::int32_t face_ = 0;
  int pixels_ = 0;  // since the last flush, after the first one
  Quad kept_[K::kSums];
};

// (sum of u, sum of v, 0, 0)
HWY_INLINE Quad SumsOfTwo(Quad u, Quad v) {
  const Quad pairs = hn::Add(hn::InterleaveLower(kQuad, u, v), hn::InterleaveUpper(kQuad, u, v));
  const Quad sums = hn::Add(pairs, hn::ConcatUpperUpper(kQuad, pairs, pairs));
  return hn::ConcatLowerLower(kQuad, hn::Zero(kQuad), sums);
}

// sum += g times e in the lanes of `counts`.
HWY_INLINE void AddProducts(QuadMask counts, Quad g, const EdgeQuads& e, EdgeQuads* sum) {
  sum->u = hn::Add(sum->u, hn::IfThenElseZero(counts, hn::Mul(g, e.u)));
  sum->v = hn::Add(sum->v, hn::IfThenElseZero(counts, hn::Mul(g, e.v)));
}

// Begin and end of cotangents, and destinations of those of rast; null: not requested.
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
  const Quad zero = hn::Zero(kQuad);
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
    if (d.rast != nullptr) hn::StoreU(SumsOfTwo(pull.u, pull.v), kQuad, d.rast + 4 * p);
    if (d.rast_db == nullptr) continue;
    hn::StoreU(hn::Add(hn::ConcatLowerLower(kQuad, slope_pull.v, slope_pull.u),
                       hn::ConcatUpperUpper(kQuad, slope_pull.v, slope_pull.u)),
               kQuad, d.rast_db + 4 * p);
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

// Both return the first pixel of the band with a face that does not exist, or kNoPixel.
std::size_t InterpolateBand(const InterpolateTask& task, const InterpolateOutput<float>& out) {
  const BandAtHand band(task);
  FaceNumbers numbers(band);
  WithKnown(band, [&]<class K>() HWY_ATTR {
    InterpolatePixels<K, true>(band, band.begin, band.whole(), &numbers, out);
    InterpolatePixels<K, false>(band, band.whole(), band.end, &numbers, out);
  });
  return numbers.bad();
}

// faces: sums per face [InterpolateSums]; null if attributes have no gradient. `scratch` has the
// same size.
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

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

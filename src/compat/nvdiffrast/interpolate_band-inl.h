// SPDX-License-Identifier: Apache-2.0
// What the pixels of a band interpolate: their faces, weights and the attributes at corners, lanes
// are channels (quads-inl.h).
#if defined(TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_BAND_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_BAND_INL_H_
#undef TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_BAND_INL_H_
#else
#define TILEGRAD_COMPAT_NVDIFFRAST_INTERPOLATE_BAND_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>

#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/quads-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The corners of a face from some channel on; beyond the last one whatever stands there.
struct CornerQuads {
  Quad a, b, c;
};

// How corners 0 and 1 differ from corner 2.
struct EdgeQuads {
  Quad u, v;

  HWY_INLINE EdgeQuads(Quad edge_u, Quad edge_v) : u(edge_u), v(edge_v) {}
  HWY_INLINE explicit EdgeQuads(const CornerQuads& q)
      : u(hn::Sub(q.a, q.c)), v(hn::Sub(q.b, q.c)) {}
  // For numbers 0 to 3 and 4 to 7 of (dA/dX, dA/dY) of the four attributes.
  HWY_INLINE EdgeQuads Twice(std::size_t half) const {
    const QuadTag d;
    return half == 0 ? EdgeQuads(hn::InterleaveLower(d, u, u), hn::InterleaveLower(d, v, v))
                     : EdgeQuads(hn::InterleaveUpper(d, u, u), hn::InterleaveUpper(d, v, v));
  }
};

// Rows of attributes of an image, of which `n` numbers count.
struct AttributeRows {
  const float *base, *end;
  std::size_t stride, n;
  std::int32_t whole;  // vertices below have four numbers from each of theirs on

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
    const QuadTag d;
    return {hn::LoadU(d, a), hn::LoadU(d, b), hn::LoadU(d, last)};
  }
};

// How many quads a row has: known when compiled, or not. Known: attributes with derivatives are the
// first ones of those that are interpolated, and in the same quad.
template <bool kIsKnown, std::size_t kSlopes>
struct Known {
  static constexpr bool kKnown = kIsKnown;
  static constexpr std::size_t kSums = kIsKnown ? 3 + 2 * kSlopes : 1;  // quads
  static HWY_INLINE std::size_t Values(std::size_t n) { return kIsKnown ? 4 : n; }
  static HWY_INLINE std::size_t Slopes(std::size_t n) { return kIsKnown ? 4 * kSlopes : n; }
};

// The pixels of a band and what is interpolated over them.
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

  // Where the last pixels begin, whose quads may reach beyond arrays.
  HWY_INLINE std::size_t whole() const { return end - HWY_MIN(end - begin, std::size_t{3}); }
  HWY_INLINE const std::int32_t* Vertices(std::int32_t face) const {
    return faces + 3 * static_cast<std::ptrdiff_t>(face) - 3;
  }
};

// Which faces pixels show, counted from 1, 0 where there is none, and the first pixel that names
// one that does not exist.
class FaceNumbers {
 public:
  HWY_INLINE explicit FaceNumbers(const BandAtHand& band)
      : rast_(band.rast), most_(std::bit_cast<std::uint32_t>(band.face_count)) {}

  HWY_INLINE std::int32_t At(std::size_t pixel) {
    const float id = rast_[4 * pixel + 3];
    // Numbers from 0 on are in the order of their bits.
    if (HWY_LIKELY(std::bit_cast<std::uint32_t>(id) <= most_)) {
      const auto face = static_cast<std::int32_t>(id);
      if (HWY_LIKELY(static_cast<float>(face) == id)) return face;
    }
    if (id != 0) bad_ = HWY_MIN(bad_, pixel);
    return 0;
  }
  // The end of the pixels from `pixel` on that show nothing.
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
    const QuadTag d;
    u = hn::Set(d, rast[0]);
    v = hn::Set(d, rast[1]);
    w = hn::Sub(hn::Sub(hn::Set(d, 1.0f), u), v);
  }
};

// (x, y, x, y) of the derivatives of u and of v.
struct SlopeQuads {
  Quad u, v;

  HWY_INLINE explicit SlopeQuads(const float* rast_db) {
    const QuadTag d;
    const Quad db = hn::LoadU(d, rast_db);
    u = hn::ConcatLowerLower(d, db, db);
    v = hn::ConcatUpperUpper(d, db, db);
  }
};

// From which numbers i to i + 3 of out_da follow; `q`: corners from the first attribute on.
template <class K>
HWY_INLINE EdgeQuads SlopeEdges(const AttributeRows& sloped, const std::int32_t* v, std::size_t i,
                                const CornerQuads& q) {
  return EdgeQuads(K::kKnown ? q : sloped.At(v, i / 8 * 4)).Twice(i % 8 / 4);
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::compat::nvdiffrast
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// A SoftRas face at a vector of pixels, for silhouettes and colours: lanes are pixels of a row. A
// face visits the pixels of its grown box.
#if defined(TILEGRAD_RIVALS_SOFTRAS_FACE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RIVALS_SOFTRAS_FACE_INL_H_
#undef TILEGRAD_RIVALS_SOFTRAS_FACE_INL_H_
#else
#define TILEGRAD_RIVALS_SOFTRAS_FACE_INL_H_
#endif

#include <hwy/highway.h>

#include "base/simd_math-inl.h"
#include "rivals/softras.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::rivals::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Most faces are narrower than eight pixels: wider vectors would waste lanes.
using SoftTag = hn::CappedTag<float, 8>;
inline constexpr SoftTag kSoft;
using SoftVec = hn::Vec<SoftTag>;
using SoftMask = hn::Mask<SoftTag>;

// Constants derived from the options.
struct SoftScale {
  float cutoff, bits_per_d;  // d * bits_per_d is the exponent to base 2
  float inverse_sigma, near_plane, far_plane;
  float floor_factor;  // of 1 - D, capped at 1, in the product's derivative

  explicit SoftScale(const SoftRasOptions& o)
      : cutoff(static_cast<float>(o.Cutoff())),
        bits_per_d(static_cast<float>(1.4426950408889634 / o.sigma)),
        inverse_sigma(static_cast<float>(1 / o.sigma)),
        near_plane(static_cast<float>(o.near_plane)),
        far_plane(static_cast<float>(o.far_plane)),
        floor_factor(static_cast<float>(1 / kSoftFloor)) {}
};

// A face at a vector of pixels.
struct SoftLanes {
  SoftVec b[3];           // barycentric weights
  SoftMask inside, live;  // live: the face reaches the pixel
  SoftVec d;              // unsigned
  SoftVec t[3], rx, ry;   // the nearest point's weights, and the vector to it (Euclidean)
  SoftVec probability, miss;
};

HWY_INLINE void SetWeights(const SoftRasFace& f, SoftVec px, SoftVec py, SoftLanes* out) {
  const SoftVec inverse_area = hn::Set(kSoft, f.inverse_area);
  for (int k = 0; k < 3; ++k) {
    const SoftVec qx = hn::Sub(px, hn::Set(kSoft, f.x[k])),
                  qy = hn::Sub(py, hn::Set(kSoft, f.y[k]));
    const SoftVec cross =
        hn::MulSub(hn::Set(kSoft, f.ex[k]), qy, hn::Mul(hn::Set(kSoft, f.ey[k]), qx));
    out->b[(k + 2) % 3] = hn::Mul(cross, inverse_area);  // of the corner beside the edge
  }
}

HWY_INLINE void SetNearestPoint(const SoftRasFace& f, SoftVec px, SoftVec py, SoftLanes* out) {
  const SoftVec zero = hn::Zero(kSoft), one = hn::Set(kSoft, 1.0f);
  for (int k = 0; k < 3; ++k) {
    const SoftVec ex = hn::Set(kSoft, f.ex[k]), ey = hn::Set(kSoft, f.ey[k]);
    const SoftVec qx = hn::Sub(px, hn::Set(kSoft, f.x[k])),
                  qy = hn::Sub(py, hn::Set(kSoft, f.y[k]));
    const SoftVec along =
        hn::Mul(hn::MulAdd(qx, ex, hn::Mul(qy, ey)), hn::Set(kSoft, f.inverse_length[k]));
    const SoftVec t = hn::Min(hn::Max(along, zero), one);
    const SoftVec rx = hn::MulSub(t, ex, qx), ry = hn::MulSub(t, ey, qy);
    const SoftVec squared = hn::MulAdd(rx, rx, hn::Mul(ry, ry));
    const SoftVec corner[3] = {hn::Sub(one, t), t, zero};  // of corners k, k + 1, k + 2
    if (k == 0) {
      out->d = squared;
      out->rx = rx;
      out->ry = ry;
      for (int c = 0; c < 3; ++c) out->t[c] = corner[c];
      continue;
    }
    const SoftMask nearer = hn::Lt(squared, out->d);
    out->d = hn::IfThenElse(nearer, squared, out->d);
    out->rx = hn::IfThenElse(nearer, rx, out->rx);
    out->ry = hn::IfThenElse(nearer, ry, out->ry);
    for (int c = 0; c < 3; ++c) {
      SoftVec* const w = &out->t[(k + c) % 3];
      *w = hn::IfThenElse(nearer, corner[c], *w);
    }
  }
}

template <SoftDistance kDistance>
HWY_INLINE SoftLanes SoftFaceAt(const SoftRasFace& f, const SoftScale& scale, SoftVec px,
                                SoftVec py) {
  const SoftVec zero = hn::Zero(kSoft), one = hn::Set(kSoft, 1.0f);
  SoftLanes out;
  SetWeights(f, px, py, &out);
  const SoftVec least = hn::Min(hn::Min(out.b[0], out.b[1]), out.b[2]);
  out.inside = hn::Gt(least, zero);
  if constexpr (kDistance == SoftDistance::kHard) {
    out.live = hn::Ge(least, zero);
    out.d = zero;
    out.probability = hn::IfThenElseZero(out.live, one);
    out.miss = hn::Sub(one, out.probability);
    return out;
  }
  if constexpr (kDistance == SoftDistance::kEuclidean) {
    SetNearestPoint(f, px, py, &out);
  } else {
    out.d = hn::Mul(least, least);
  }
  out.live = hn::Or(out.inside, hn::Lt(out.d, hn::Set(kSoft, scale.cutoff)));
  if constexpr (kDistance == SoftDistance::kBarycentric) {  // the box clips there, too
    out.live = hn::And(out.live, hn::And(hn::Ge(px, hn::Set(kSoft, f.low_x)),
                                         hn::Le(px, hn::Set(kSoft, f.high_x))));
  }
  const SoftVec e =
      tilegrad::HWY_NAMESPACE::Exp2Neg(kSoft, hn::Mul(out.d, hn::Set(kSoft, scale.bits_per_d)))
          .power;
  const SoftVec large = hn::Div(one, hn::Add(one, e)), small = hn::Mul(e, large);
  out.probability = hn::IfThenElseZero(out.live, hn::IfThenElse(out.inside, large, small));
  out.miss = hn::IfThenElse(out.live, hn::IfThenElse(out.inside, small, large), one);
  return out;
}

HWY_INLINE SoftVec ColumnCentres(int column, int size) {
  const SoftVec twice = tilegrad::HWY_NAMESPACE::CountFrom(kSoft, static_cast<float>(column));
  return hn::Mul(hn::Add(hn::Add(twice, twice), hn::Set(kSoft, static_cast<float>(1 - size))),
                 hn::Set(kSoft, 1.0f / static_cast<float>(size)));
}

// Calls visit(offset in the image's arrays, px, py) for the vectors of a face's box.
template <class Visit>
HWY_INLINE void ForFaceVectors(const SoftRasFace& f, RowRange rows, const SoftRasImage& image,
                               const Visit& visit) {
  const int lanes = static_cast<int>(hn::Lanes(kSoft)), size = image.size;
  for (int i = HWY_MAX(rows.begin, f.row_begin); i < HWY_MIN(rows.end, f.row_end); ++i) {
    const SoftVec py = hn::Set(kSoft, CentreY<float>(i, size));
    for (int j = f.column_begin; j < f.column_end; j += lanes) {
      visit(static_cast<std::size_t>(i) * image.stride + static_cast<std::size_t>(j),
            ColumnCentres(j, size), py);
    }
  }
}

struct CornerSums {
  SoftVec x[3], y[3];
};

HWY_INLINE void AddEuclidean(const SoftLanes& at, SoftVec d_d, CornerSums* sums) {
  const SoftVec twice = hn::Add(d_d, d_d), push = hn::IfThenElse(at.inside, twice, hn::Neg(twice));
  const SoftVec x = hn::Mul(push, at.rx), y = hn::Mul(push, at.ry);
  for (int k = 0; k < 3; ++k) {
    sums->x[k] = hn::MulAdd(at.t[k], x, sums->x[k]);
    sums->y[k] = hn::MulAdd(at.t[k], y, sums->y[k]);
  }
}

// The smallest weight m moves by -b_k grad m when corner k does.
HWY_INLINE void AddBarycentric(const SoftRasFace& f, const SoftLanes& at, SoftVec d_d,
                               CornerSums* sums) {
  SoftVec least = at.b[0];
  // Weight k falls away from edge k + 1, which leads from corner k + 1 to corner k + 2.
  SoftVec gx = hn::Set(kSoft, -f.ey[1] * f.inverse_area),
          gy = hn::Set(kSoft, f.ex[1] * f.inverse_area);
  for (int k = 1; k < 3; ++k) {
    const SoftMask less = hn::Lt(at.b[k], least);
    const int edge = (k + 1) % 3;
    least = hn::IfThenElse(less, at.b[k], least);
    gx = hn::IfThenElse(less, hn::Set(kSoft, -f.ey[edge] * f.inverse_area), gx);
    gy = hn::IfThenElse(less, hn::Set(kSoft, f.ex[edge] * f.inverse_area), gy);
  }
  const SoftVec push = hn::Mul(hn::Add(d_d, d_d), hn::Abs(least));
  const SoftVec x = hn::Mul(push, gx), y = hn::Mul(push, gy);
  for (int k = 0; k < 3; ++k) {
    sums->x[k] = hn::NegMulAdd(at.b[k], x, sums->x[k]);
    sums->y[k] = hn::NegMulAdd(at.b[k], y, sums->y[k]);
  }
}

}  // namespace tilegrad::rivals::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif

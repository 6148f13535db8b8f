// SPDX-License-Identifier: Apache-2.0
// Vector body of softras_color.h: lanes are pixels of a row, as in softras_face-inl.h.

#include <hwy/highway.h>

#include "rivals/softras_color.h"
#include "rivals/softras_face-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::rivals::HWY_NAMESPACE {

// A difference of nearness, -z, times `bits` is the exponent to base 2 of a ratio of weights.
struct ColorScale {
  float bits;
  float slope;  // d(weight)/d(nearness) / weight

  ColorScale(const SoftRasOptions& o, const SoftRasColors& c) {
    const double range = o.far_plane - o.near_plane;
    slope = static_cast<float>(1 / (range * c.gamma));
    bits = static_cast<float>(1.4426950408889634 / (range * c.gamma));
  }
};

// A face's depth and colour at a vector of pixels.
struct ColorLanes {
  SoftLanes soft;
  SoftMask counts;  // pixels where the face may contribute colour
  SoftVec w[3], sum, z, nearness;
  SoftVec color[3];
};

// 2^(difference * bits) for differences <= 0.
HWY_INLINE SoftVec RelativeWeight(const ColorScale& scale, SoftVec difference) {
  const SoftVec bits = hn::Mul(hn::Neg(difference), hn::Set(kSoft, scale.bits));
  return tilegrad::HWY_NAMESPACE::Exp2Neg(kSoft, bits).power;
}

HWY_INLINE void SetDepth(const SoftRasFace& f, const SoftScale& soft, ColorLanes* out) {
  SoftVec over_z = hn::Zero(kSoft);
  out->sum = hn::Zero(kSoft);
  for (int k = 0; k < 3; ++k) {
    out->w[k] = hn::Min(hn::Max(out->soft.b[k], hn::Zero(kSoft)), hn::Set(kSoft, 1.0f));
    out->sum = hn::Add(out->sum, out->w[k]);
    over_z = hn::MulAdd(out->w[k], hn::Set(kSoft, 1.0f / f.z[k]), over_z);
  }
  for (SoftVec& w : out->w) w = hn::Div(w, out->sum);
  out->z = hn::Div(out->sum, over_z);
  out->counts = hn::And(out->soft.live, hn::And(hn::Ge(out->z, hn::Set(kSoft, soft.near_plane)),
                                                hn::Le(out->z, hn::Set(kSoft, soft.far_plane))));
  out->nearness = hn::Neg(out->z);
}

// textures: of this face.
HWY_INLINE void SetColor(const float* textures, ColorLanes* out) {
  for (int c = 0; c < 3; ++c) {
    out->color[c] = hn::Mul(out->w[0], hn::Set(kSoft, textures[c]));
    out->color[c] = hn::MulAdd(out->w[1], hn::Set(kSoft, textures[3 + c]), out->color[c]);
    out->color[c] = hn::MulAdd(out->w[2], hn::Set(kSoft, textures[6 + c]), out->color[c]);
  }
}

template <SoftDistance kDistance>
HWY_INLINE ColorLanes ColorFaceAt(const SoftRasFace& f, const SoftScale& soft,
                                  const float* textures, SoftVec px, SoftVec py) {
  ColorLanes out;
  out.soft = SoftFaceAt<kDistance>(f, soft, px, py);
  SetDepth(f, soft, &out);
  SetColor(textures, &out);
  return out;
}

// The planes of one vector of pixels.
struct MixedPixels {
  float *nearest, *total, *color[3];

  HWY_INLINE MixedPixels(SoftRasColorImage* image, std::size_t at)
      : nearest(image->nearest.data() + at), total(image->total.data() + at) {
    const std::size_t plane = image->total.size();
    for (std::size_t c = 0; c < 3; ++c) color[c] = image->color.data() + c * plane + at;
  }
};

HWY_INLINE void MixFace(const ColorLanes& at, const ColorScale& scale, const MixedPixels& to) {
  const SoftVec before = hn::LoadU(kSoft, to.nearest);
  const SoftVec after = hn::IfThenElse(at.counts, hn::Max(before, at.nearness), before);
  const SoftVec fade = RelativeWeight(scale, hn::Sub(before, after));
  const SoftVec weight = hn::IfThenElseZero(
      at.counts,
      hn::Mul(
          at.soft.probability,
          RelativeWeight(scale, hn::Sub(hn::IfThenElse(at.counts, at.nearness, after), after))));
  hn::StoreU(after, kSoft, to.nearest);
  hn::StoreU(hn::MulAdd(hn::LoadU(kSoft, to.total), fade, weight), kSoft, to.total);
  for (int c = 0; c < 3; ++c) {
    const SoftVec part = hn::IfThenElseZero(at.counts, hn::Mul(weight, at.color[c]));
    hn::StoreU(hn::MulAdd(hn::LoadU(kSoft, to.color[c]), fade, part), kSoft, to.color[c]);
  }
}

template <SoftDistance kDistance>
HWY_INLINE void ForwardColorFaces(const SoftRasColorJob& job, RowRange rows,
                                  SoftRasColorImage* mixed) {
  const SoftScale soft(job.options);
  const ColorScale scale(job.options, job.colors);
  for (std::size_t f = 0; f < job.image.faces.size(); ++f) {
    const SoftRasFace& face = job.image.faces[f];
    const float* const textures = job.textures.data() + 3 * kSoftTexels * f;
    ForFaceVectors(face, rows, job.image, [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
      MixFace(ColorFaceAt<kDistance>(face, soft, textures, px, py), scale, MixedPixels(mixed, at));
    });
  }
}

void ForwardColors(const SoftRasColorJob& job, RowRange rows, SoftRasColorImage* mixed) {
  switch (job.options.distance) {
    case SoftDistance::kHard:
      return ForwardColorFaces<SoftDistance::kHard>(job, rows, mixed);
    case SoftDistance::kBarycentric:
      return ForwardColorFaces<SoftDistance::kBarycentric>(job, rows, mixed);
    case SoftDistance::kEuclidean:
      return ForwardColorFaces<SoftDistance::kEuclidean>(job, rows, mixed);
  }
}

// The adjoint of softras_color-inl.h. A face sums over the pixels of its box.

struct ColorSums {
  CornerSums corners;
  SoftVec over_z[3];     // times 1/z_k^2: dL/dz_k
  SoftVec vertex[3][3];  // [corner][channel] of vertex colours
};

HWY_INLINE void ClearSums(ColorSums* sums) {
  const SoftVec zero = hn::Zero(kSoft);
  for (int k = 0; k < 3; ++k) {
    sums->corners.x[k] = sums->corners.y[k] = sums->over_z[k] = zero;
    for (SoftVec& v : sums->vertex[k]) v = zero;
  }
}

// Cotangents of the pixels.
struct ColorPush {
  SoftVec g[3], mean;  // dL/dI, and its product with I

  HWY_INLINE ColorPush(const SoftRasColorImage& image, std::size_t at) {
    const std::size_t plane = image.total.size();
    for (std::size_t c = 0; c < 3; ++c) g[c] = hn::LoadU(kSoft, &image.push[c * plane + at]);
    mean = hn::LoadU(kSoft, &image.push[3 * plane + at]);
  }
};

struct ColorFace {
  const SoftRasColorJob& job;
  const SoftRasFace& face;
  ColorScale scale;
  const float* textures;  // of the face
};

// Adds to the texels of a face, in the lanes that count.
HWY_INLINE void AddTexels(const ColorLanes& at, SoftVec weight, const ColorPush& push,
                          ColorSums* sums) {
  for (int k = 0; k < 3; ++k) {
    const SoftVec share = hn::IfThenElseZero(at.counts, hn::Mul(weight, at.w[k]));
    for (int c = 0; c < 3; ++c)
      sums->vertex[k][c] = hn::MulAdd(share, push.g[c], sums->vertex[k][c]);
  }
}

// The repair: corners also move the interpolation weights of colour and depth.
HWY_INLINE void AddWeightMoves(const SoftRasFace& f, const ColorLanes& at, const SoftVec d_w[3],
                               CornerSums* sums) {
  const SoftVec zero = hn::Zero(kSoft), one = hn::Set(kSoft, 1.0f);
  SoftVec mean = zero, gx = zero, gy = zero;
  for (int k = 0; k < 3; ++k) mean = hn::MulAdd(at.w[k], d_w[k], mean);
  for (int k = 0; k < 3; ++k) {
    const SoftVec b = at.soft.b[k];
    const SoftMask free = hn::And(at.counts, hn::And(hn::Gt(b, zero), hn::Lt(b, one)));
    const SoftVec d_b = hn::IfThenElseZero(free, hn::Div(hn::Sub(d_w[k], mean), at.sum));
    const int edge = (k + 1) % 3;
    gx = hn::MulAdd(d_b, hn::Set(kSoft, -f.ey[edge] * f.inverse_area), gx);
    gy = hn::MulAdd(d_b, hn::Set(kSoft, f.ex[edge] * f.inverse_area), gy);
  }
  for (int k = 0; k < 3; ++k) {
    sums->x[k] = hn::NegMulAdd(at.soft.b[k], gx, sums->x[k]);
    sums->y[k] = hn::NegMulAdd(at.soft.b[k], gy, sums->y[k]);
  }
}

// Through depth, whose adjoint is d_z; with the repair also through the weights.
HWY_INLINE void AddDepthMoves(const ColorFace& of, const ColorLanes& at, SoftVec d_z,
                              SoftVec weight, const ColorPush& push, ColorSums* sums) {
  const SoftVec d_zz = hn::IfThenElseZero(at.counts, hn::Mul(d_z, hn::Mul(at.z, at.z)));
  for (int k = 0; k < 3; ++k) sums->over_z[k] = hn::MulAdd(d_zz, at.w[k], sums->over_z[k]);
  if (!of.job.colors.position_gradient) return;
  SoftVec d_w[3];
  for (int k = 0; k < 3; ++k) {
    d_w[k] = hn::Mul(d_zz, hn::Set(kSoft, -1.0f / of.face.z[k]));
    for (int c = 0; c < 3; ++c)
      d_w[k] =
          hn::MulAdd(hn::Mul(weight, push.g[c]), hn::Set(kSoft, of.textures[3 * k + c]), d_w[k]);
  }
  AddWeightMoves(of.face, at, d_w, &sums->corners);
}

// One vector of the mixture.
template <SoftDistance kDistance>
HWY_INLINE void AddMixture(const ColorFace& of, const ColorLanes& at,
                           const SoftRasColorImage& mixed, std::size_t pixel, ColorSums* sums) {
  const ColorPush push(mixed, pixel);
  const SoftVec nearest = hn::LoadU(kSoft, &mixed.nearest[pixel]);
  const SoftVec behind = hn::Sub(hn::IfThenElse(at.counts, at.nearness, nearest), nearest);
  const SoftVec per_probability = hn::IfThenElseZero(
      at.counts, hn::Div(RelativeWeight(of.scale, behind), hn::LoadU(kSoft, &mixed.total[pixel])));
  const SoftVec weight = hn::Mul(at.soft.probability, per_probability);
  SoftVec along = hn::Neg(push.mean);
  for (int c = 0; c < 3; ++c) along = hn::MulAdd(push.g[c], at.color[c], along);
  along = hn::IfThenElseZero(at.counts, along);
  AddTexels(at, weight, push, sums);
  if constexpr (kDistance != SoftDistance::kHard) {
    const SoftVec slope =
        hn::Mul(hn::Mul(at.soft.miss, hn::Set(kSoft, 1 / static_cast<float>(of.job.options.sigma))),
                weight);
    const SoftVec d_d = hn::Mul(along, slope);
    if constexpr (kDistance == SoftDistance::kEuclidean) {
      AddEuclidean(at.soft, d_d, &sums->corners);
    } else {
      AddBarycentric(of.face, at.soft, d_d, &sums->corners);
    }
  }
  const SoftVec d_z = hn::Mul(hn::Mul(weight, along), hn::Set(kSoft, -of.scale.slope));
  AddDepthMoves(of, at, d_z, weight, push, sums);
}

HWY_INLINE void StoreSums(const SoftRasFace& f, const ColorSums& sums, float* d_corners,
                          float* d_textures) {
  const auto total = [&](SoftVec v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(kSoft, v)); };
  for (int k = 0; k < 3; ++k) {
    d_corners[3 * k] += total(sums.corners.x[k]);
    d_corners[3 * k + 1] += total(sums.corners.y[k]);
    d_corners[3 * k + 2] += total(sums.over_z[k]) / (f.z[k] * f.z[k]);
    for (int c = 0; c < 3; ++c) d_textures[3 * k + c] = total(sums.vertex[k][c]);
  }
}

template <SoftDistance kDistance>
HWY_INLINE void BackwardColorFace(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                                  std::size_t f, const SoftRasColorAdjoints& out) {
  const SoftRasFace& face = job.image.faces[f];
  const SoftScale soft(job.options);
  const std::size_t numbers = 3 * kSoftTexels;
  const ColorFace of{job, face, ColorScale(job.options, job.colors),
                     job.textures.data() + numbers * f};
  float* const d_textures = out.d_textures.data() + numbers * f;
  for (std::size_t i = 0; i < numbers; ++i) d_textures[i] = 0;
  if (face.row_begin >= face.row_end) return;
  ColorSums sums;
  ClearSums(&sums);
  ForFaceVectors(face, {0, job.image.size}, job.image,
                 [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
                   const ColorLanes here = ColorFaceAt<kDistance>(face, soft, of.textures, px, py);
                   AddMixture<kDistance>(of, here, mixed, at, &sums);
                 });
  StoreSums(face, sums, out.d_corners.data() + kCornerNumbers * f, d_textures);
}

void BackwardColors(const SoftRasColorJob& job, const SoftRasColorImage& mixed, std::size_t begin,
                    std::size_t end, const SoftRasColorAdjoints& out) {
  for (std::size_t f = begin; f < end; ++f) {
    switch (job.options.distance) {
      case SoftDistance::kHard:
        BackwardColorFace<SoftDistance::kHard>(job, mixed, f, out);
        break;
      case SoftDistance::kBarycentric:
        BackwardColorFace<SoftDistance::kBarycentric>(job, mixed, f, out);
        break;
      case SoftDistance::kEuclidean:
        BackwardColorFace<SoftDistance::kEuclidean>(job, mixed, f, out);
        break;
    }
  }
}

}  // namespace tilegrad::rivals::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

// SPDX-License-Identifier: Apache-2.0
// The adjoint of softras_color-inl.h. A face sums over the pixels of its box.
#if defined(TILEGRAD_RIVALS_SOFTRAS_COLOR_BACKWARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RIVALS_SOFTRAS_COLOR_BACKWARD_INL_H_
#undef TILEGRAD_RIVALS_SOFTRAS_COLOR_BACKWARD_INL_H_
#else
#define TILEGRAD_RIVALS_SOFTRAS_COLOR_BACKWARD_INL_H_
#endif

#include <hwy/highway.h>

#include "rivals/softras_color-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::rivals {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

struct ColorSums {
  CornerSums corners;
  SoftVec over_z[3];     // times 1/z_k^2: dL/dz_k
  SoftVec vertex[3][3];  // [corner][channel] of vertex colours
};

HWY_INLINE void ClearSums(ColorSums* sums) {
  const SoftVec zero = hn::Zero(SoftTag());
  for (int k = 0; k < 3; ++k) {
    sums->corners.x[k] = sums->corners.y[k] = sums->over_z[k] = zero;
    for (SoftVec& v : sums->vertex[k]) v = zero;
  }
}

// What the pixels want.
struct ColorPush {
  SoftVec g[3], mean;  // dL/dI, and its product with I

  HWY_INLINE ColorPush(const SoftRasColorImage& image, std::size_t at) {
    const SoftTag d;
    const std::size_t plane = image.total.size();
    for (std::size_t c = 0; c < 3; ++c) g[c] = hn::LoadU(d, &image.push[c * plane + at]);
    mean = hn::LoadU(d, &image.push[3 * plane + at]);
  }
};

// A face and where the adjoint of its texels goes.
struct ColorFace {
  const SoftRasColorJob& job;
  const SoftRasFace& face;
  ColorScale scale;
  const float* textures;  // of the face
  float* d_textures;
};

// To the texels of a face, of the lanes that count.
HWY_INLINE void AddTexels(const SoftRasColors& colors, const ColorLanes& at, SoftVec weight,
                          const ColorPush& push, ColorSums* sums, float* d_textures) {
  const SoftTag d;
  if (colors.texture == SoftTexture::kVertex) {
    for (int k = 0; k < 3; ++k) {
      const SoftVec share = hn::IfThenElseZero(at.counts, hn::Mul(weight, at.w[k]));
      for (int c = 0; c < 3; ++c)
        sums->vertex[k][c] = hn::MulAdd(share, push.g[c], sums->vertex[k][c]);
    }
    return;
  }
  HWY_ALIGN std::int32_t texel[hn::MaxLanes(SoftTag())];
  HWY_ALIGN float part[hn::MaxLanes(SoftTag())];
  hn::Store(at.texel, SoftIntTag(), texel);
  for (int c = 0; c < 3; ++c) {
    hn::Store(hn::Mul(weight, push.g[c]), d, part);
    for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane)
      d_textures[3 * texel[lane] + c] += part[lane];
  }
}

// The repair: corners move the weights that colour and depth are interpolated by.
HWY_INLINE void AddWeightMoves(const SoftRasFace& f, const ColorLanes& at, const SoftVec d_w[3],
                               CornerSums* sums) {
  const SoftTag d;
  const SoftVec zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  SoftVec mean = zero, gx = zero, gy = zero;
  for (int k = 0; k < 3; ++k) mean = hn::MulAdd(at.w[k], d_w[k], mean);
  for (int k = 0; k < 3; ++k) {
    const SoftVec b = at.soft.b[k];
    const SoftMask free = hn::And(at.counts, hn::And(hn::Gt(b, zero), hn::Lt(b, one)));
    const SoftVec d_b = hn::IfThenElseZero(free, hn::Div(hn::Sub(d_w[k], mean), at.sum));
    const int edge = (k + 1) % 3;
    gx = hn::MulAdd(d_b, hn::Set(d, -f.ey[edge] * f.inverse_area), gx);
    gy = hn::MulAdd(d_b, hn::Set(d, f.ex[edge] * f.inverse_area), gy);
  }
  for (int k = 0; k < 3; ++k) {
    sums->x[k] = hn::NegMulAdd(at.soft.b[k], gx, sums->x[k]);
    sums->y[k] = hn::NegMulAdd(at.soft.b[k], gy, sums->y[k]);
  }
}

// Through depth, whose adjoint is d_z; with the repair through the weights, too.
HWY_INLINE void AddDepthMoves(const ColorFace& of, const ColorLanes& at, SoftVec d_z,
                              SoftVec weight, const ColorPush& push, ColorSums* sums) {
  const SoftTag d;
  const SoftVec d_zz = hn::IfThenElseZero(at.counts, hn::Mul(d_z, hn::Mul(at.z, at.z)));
  for (int k = 0; k < 3; ++k) sums->over_z[k] = hn::MulAdd(d_zz, at.w[k], sums->over_z[k]);
  const SoftRasColors& colors = of.job.colors;
  if (!colors.position_gradient) return;
  SoftVec d_w[3];
  for (int k = 0; k < 3; ++k) {
    d_w[k] = hn::Mul(d_zz, hn::Set(d, -1.0f / of.face.z[k]));
    for (int c = 0; c < 3 && colors.texture == SoftTexture::kVertex; ++c)
      d_w[k] = hn::MulAdd(hn::Mul(weight, push.g[c]), hn::Set(d, of.textures[3 * k + c]), d_w[k]);
  }
  AddWeightMoves(of.face, at, d_w, &sums->corners);
}

// One vector of a softmax.
template <SoftDistance kDistance>
HWY_INLINE void AddMixture(const ColorFace& of, const ColorLanes& at,
                           const SoftRasColorImage& mixed, std::size_t pixel, ColorSums* sums) {
  const SoftTag d;
  const ColorPush push(mixed, pixel);
  const SoftVec nearest = hn::LoadU(d, &mixed.nearest[pixel]);
  const SoftVec behind = hn::Sub(hn::IfThenElse(at.counts, at.nearness, nearest), nearest);
  const SoftVec per_probability = hn::IfThenElseZero(
      at.counts, hn::Div(RelativeWeight(of.scale, behind), hn::LoadU(d, &mixed.total[pixel])));
  const SoftVec weight = hn::Mul(at.soft.probability, per_probability);
  SoftVec along = hn::Neg(push.mean);
  for (int c = 0; c < 3; ++c) along = hn::MulAdd(push.g[c], at.color[c], along);
  along = hn::IfThenElseZero(at.counts, along);
  AddTexels(of.job.colors, at, weight, push, sums, of.d_textures);
  if constexpr (kDistance != SoftDistance::kHard) {
    const SoftVec slope = hn::Mul(
        hn::Mul(at.soft.miss, hn::Set(d, 1 / static_cast<float>(of.job.options.sigma))), weight);
    const SoftVec d_d = hn::Mul(along, slope);
    if constexpr (kDistance == SoftDistance::kEuclidean) {
      AddEuclidean(at.soft, d_d, &sums->corners);
    } else {
      AddBarycentric(of.face, at.soft, d_d, &sums->corners);
    }
  }
  // d(nearness)/dz is -1, or -1/z^2.
  SoftVec d_z = hn::Mul(hn::Mul(weight, along), hn::Set(d, -of.scale.slope));
  if (of.scale.inverse) d_z = hn::Mul(d_z, hn::Mul(at.nearness, at.nearness));
  AddDepthMoves(of, at, d_z, weight, push, sums);
}

// One vector of the nearest face's own colours.
HWY_INLINE void AddCover(const ColorFace& of, const ColorLanes& at, std::int32_t face,
                         const SoftRasColorImage& mixed, std::size_t pixel, ColorSums* sums) {
  const SoftTag d;
  const SoftIntTag di;
  const auto own = hn::Eq(hn::LoadU(di, &mixed.cover[pixel]), hn::Set(di, face));
  const SoftVec weight = hn::IfThenElseZero(hn::RebindMask(d, own), hn::Set(d, 1.0f));
  AddTexels(of.job.colors, at, weight, ColorPush(mixed, pixel), sums, of.d_textures);
}

HWY_INLINE void StoreSums(const SoftRasFace& f, const SoftRasColors& colors, const ColorSums& sums,
                          float* d_corners, float* d_textures) {
  const SoftTag d;
  const auto total = [&](SoftVec v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  for (int k = 0; k < 3; ++k) {
    d_corners[3 * k] += total(sums.corners.x[k]);
    d_corners[3 * k + 1] += total(sums.corners.y[k]);
    d_corners[3 * k + 2] += total(sums.over_z[k]) / (f.z[k] * f.z[k]);
    if (colors.texture != SoftTexture::kVertex) continue;
    for (int c = 0; c < 3; ++c) d_textures[3 * k + c] = total(sums.vertex[k][c]);
  }
}

template <SoftDistance kDistance>
HWY_INLINE void BackwardColorFace(const SoftRasColorJob& job, const SoftRasColorImage& mixed,
                                  std::size_t f, const SoftRasColorAdjoints& out) {
  const SoftRasFace& face = job.image.faces[f];
  const SoftScale soft(job.options);
  const std::size_t numbers = 3 * job.colors.texels();
  const ColorFace of{job, face, ColorScale(job.options, job.colors),
                     job.textures.data() + numbers * f, out.d_textures.data() + numbers * f};
  for (std::size_t i = 0; i < numbers; ++i) of.d_textures[i] = 0;
  if (!HasColor(face, job.colors) || face.row_begin >= face.row_end) return;
  ColorSums sums;
  ClearSums(&sums);
  ForFaceVectors(
      face, {0, job.image.size}, job.image, [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
        const ColorLanes here =
            ColorFaceAt<kDistance>(face, job.colors, soft, of.scale, of.textures, px, py);
        if (job.colors.color == SoftColor::kSoftmax) {
          AddMixture<kDistance>(of, here, mixed, at, &sums);
        } else {
          AddCover(of, here, static_cast<std::int32_t>(f), mixed, at, &sums);
        }
      });
  StoreSums(face, job.colors, sums, out.d_corners.data() + kCornerNumbers * f, of.d_textures);
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

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::rivals
HWY_AFTER_NAMESPACE();

#endif

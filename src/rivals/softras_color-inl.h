// SPDX-License-Identifier: Apache-2.0
// Vector body of softras_color.h: lanes are pixels of a row, as in softras_face-inl.h.
#if defined(TILEGRAD_RIVALS_SOFTRAS_COLOR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RIVALS_SOFTRAS_COLOR_INL_H_
#undef TILEGRAD_RIVALS_SOFTRAS_COLOR_INL_H_
#else
#define TILEGRAD_RIVALS_SOFTRAS_COLOR_INL_H_
#endif

#include <hwy/highway.h>

#include "rivals/softras_color.h"
#include "rivals/softras_face-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::rivals {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SoftIntTag = hn::RebindToSigned<SoftTag>;

// A difference of nearness (SoftNearness) times `bits` is the exponent to base 2 of a ratio of
// weights.
struct ColorScale {
  float bits;
  float slope;  // d(weight)/d(nearness) / weight
  bool inverse;

  ColorScale(const SoftRasOptions& o, const SoftRasColors& c) : inverse(c.inverse_depth) {
    const double range = NearnessOf(o, c).range;
    slope = static_cast<float>(1 / (range * c.gamma));
    bits = static_cast<float>(1.4426950408889634 / (range * c.gamma));
  }
};

// A face's depth and colour at the pixels of a vector.
struct ColorLanes {
  SoftLanes soft;
  SoftMask counts;  // the pixels where it may have colour
  SoftVec w[3], sum, z, nearness;
  SoftVec share[3], color[3];
  hn::Vec<SoftIntTag> texel;  // kSurface
};

// 2^(difference * bits) for differences <= 0.
HWY_INLINE SoftVec RelativeWeight(const ColorScale& scale, SoftVec difference) {
  const SoftTag d;
  const SoftVec bits = hn::Mul(hn::Neg(difference), hn::Set(d, scale.bits));
  return tilegrad::HWY_NAMESPACE::Exp2Neg(d, bits).power;
}

HWY_INLINE void SetDepth(const SoftRasFace& f, const SoftScale& soft, const ColorScale& scale,
                         ColorLanes* out) {
  const SoftTag d;
  SoftVec over_z = hn::Zero(d);
  out->sum = hn::Zero(d);
  for (int k = 0; k < 3; ++k) {
    out->w[k] = hn::Min(hn::Max(out->soft.b[k], hn::Zero(d)), hn::Set(d, 1.0f));
    out->sum = hn::Add(out->sum, out->w[k]);
    over_z = hn::MulAdd(out->w[k], hn::Set(d, 1.0f / f.z[k]), over_z);
  }
  for (SoftVec& w : out->w) w = hn::Div(w, out->sum);
  out->z = hn::Div(out->sum, over_z);
  out->counts = hn::And(out->soft.live, hn::And(hn::Ge(out->z, hn::Set(d, soft.near_plane)),
                                                hn::Le(out->z, hn::Set(d, soft.far_plane))));
  out->nearness = scale.inverse ? hn::Div(hn::Set(d, 1.0f), out->z) : hn::Neg(out->z);
}

// SoftTexel of each lane.
HWY_INLINE hn::Vec<SoftIntTag> TexelLanes(const ColorLanes& at, int resolution) {
  const SoftTag d;
  const SoftIntTag di;
  const SoftVec scale = hn::Set(d, static_cast<float>(resolution));
  const auto last = hn::Set(di, resolution - 1), r = hn::Set(di, resolution);
  const SoftVec u = hn::Mul(at.w[0], scale), v = hn::Mul(at.w[1], scale);
  const auto x = hn::Min(hn::ConvertTo(di, u), last), y = hn::Min(hn::ConvertTo(di, v), last);
  const SoftVec rest = hn::Sub(hn::Add(u, v), hn::ConvertTo(d, hn::Add(x, y)));
  const auto lower = hn::RebindMask(di, hn::Le(rest, hn::Set(d, 1.0f + 1e-5f)));
  const auto straight = hn::Add(hn::Mul(y, r), x);
  const auto mirrored = hn::Add(hn::Mul(hn::Sub(last, y), r), hn::Sub(last, x));
  // Lanes that do not count may hold anything.
  const auto texel = hn::IfThenElse(lower, straight, mirrored);
  return hn::IfThenElseZero(hn::RebindMask(di, at.counts), texel);
}

// textures: of the face.
HWY_INLINE void SetColor(const SoftRasColors& colors, const float* textures, ColorLanes* out) {
  const SoftTag d;
  if (colors.texture == SoftTexture::kVertex) {
    for (int c = 0; c < 3; ++c) {
      out->color[c] = hn::Mul(out->w[0], hn::Set(d, textures[c]));
      out->color[c] = hn::MulAdd(out->w[1], hn::Set(d, textures[3 + c]), out->color[c]);
      out->color[c] = hn::MulAdd(out->w[2], hn::Set(d, textures[6 + c]), out->color[c]);
    }
    return;
  }
  const SoftIntTag di;
  out->texel = TexelLanes(*out, colors.resolution);
  const auto at = hn::Mul(out->texel, hn::Set(di, 3));
  for (int c = 0; c < 3; ++c)
    out->color[c] = hn::GatherIndex(d, textures, hn::Add(at, hn::Set(di, c)));
}

template <SoftDistance kDistance>
HWY_INLINE ColorLanes ColorFaceAt(const SoftRasFace& f, const SoftRasColors& colors,
                                  const SoftScale& soft, const ColorScale& scale,
                                  const float* textures, SoftVec px, SoftVec py) {
  ColorLanes out;
  out.soft = SoftFaceAt<kDistance>(f, soft, px, py);
  SetDepth(f, soft, scale, &out);
  if (colors.color == SoftColor::kHard) {
    const SoftVec least = hn::Min(hn::Min(out.soft.b[0], out.soft.b[1]), out.soft.b[2]);
    out.counts = hn::And(out.counts, hn::Ge(least, hn::Zero(SoftTag())));
  }
  SetColor(colors, textures, &out);
  return out;
}

// The planes of one vector of pixels.
struct MixedPixels {
  float *nearest, *total, *color[3];
  std::int32_t* cover;

  HWY_INLINE MixedPixels(SoftRasColorImage* image, std::size_t at)
      : nearest(image->nearest.data() + at),
        total(image->total.data() + at),
        cover(image->cover.data() + at) {
    const std::size_t plane = image->total.size();
    for (std::size_t c = 0; c < 3; ++c) color[c] = image->color.data() + c * plane + at;
  }
};

HWY_INLINE void MixFace(const ColorLanes& at, const ColorScale& scale, const MixedPixels& to) {
  const SoftTag d;
  const SoftVec before = hn::LoadU(d, to.nearest);
  const SoftVec after = hn::IfThenElse(at.counts, hn::Max(before, at.nearness), before);
  const SoftVec fade = RelativeWeight(scale, hn::Sub(before, after));
  const SoftVec weight = hn::IfThenElseZero(
      at.counts,
      hn::Mul(
          at.soft.probability,
          RelativeWeight(scale, hn::Sub(hn::IfThenElse(at.counts, at.nearness, after), after))));
  hn::StoreU(after, d, to.nearest);
  hn::StoreU(hn::MulAdd(hn::LoadU(d, to.total), fade, weight), d, to.total);
  for (int c = 0; c < 3; ++c) {
    const SoftVec part = hn::IfThenElseZero(at.counts, hn::Mul(weight, at.color[c]));
    hn::StoreU(hn::MulAdd(hn::LoadU(d, to.color[c]), fade, part), d, to.color[c]);
  }
}

HWY_INLINE void CoverFace(const ColorLanes& at, std::int32_t face, const MixedPixels& to) {
  const SoftTag d;
  const SoftIntTag di;
  const SoftMask nearer = hn::And(at.counts, hn::Gt(at.nearness, hn::LoadU(d, to.nearest)));
  hn::BlendedStore(at.nearness, nearer, d, to.nearest);
  hn::BlendedStore(hn::Set(di, face), hn::RebindMask(di, nearer), di, to.cover);
  for (int c = 0; c < 3; ++c) hn::BlendedStore(at.color[c], nearer, d, to.color[c]);
}

HWY_INLINE bool HasColor(const SoftRasFace& f, const SoftRasColors& colors) {
  return colors.double_side || f.inverse_area < 0;
}

template <SoftDistance kDistance>
HWY_INLINE void ForwardColorFaces(const SoftRasColorJob& job, RowRange rows,
                                  SoftRasColorImage* mixed) {
  const SoftScale soft(job.options);
  const ColorScale scale(job.options, job.colors);
  for (std::size_t f = 0; f < job.image.faces.size(); ++f) {
    const SoftRasFace& face = job.image.faces[f];
    if (!HasColor(face, job.colors)) continue;
    const float* const textures = job.textures.data() + 3 * job.colors.texels() * f;
    ForFaceVectors(face, rows, job.image, [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
      const ColorLanes here =
          ColorFaceAt<kDistance>(face, job.colors, soft, scale, textures, px, py);
      const MixedPixels to(mixed, at);
      if (job.colors.color == SoftColor::kSoftmax) {
        MixFace(here, scale, to);
      } else {
        CoverFace(here, static_cast<std::int32_t>(f), to);
      }
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

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::rivals
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of softras.h.

#include <hwy/highway.h>

#include "rivals/softras.h"
#include "rivals/softras_face-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::rivals::HWY_NAMESPACE {

template <SoftDistance kDistance>
HWY_INLINE void ForwardFaces(const SoftRasOptions& options, RowRange rows, SoftRasImage* image) {
  const SoftScale scale(options);
  const SoftAlpha rule = options.alpha;
  for (const SoftRasFace& face : image->faces) {
    ForFaceVectors(face, rows, *image, [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
      const SoftLanes here = SoftFaceAt<kDistance>(face, scale, px, py);
      float* const kept = image->kept.data() + at;
      const SoftVec before = hn::LoadU(kSoft, kept);
      const SoftVec after = rule == SoftAlpha::kProduct ? hn::Mul(before, here.miss)
                            : rule == SoftAlpha::kSum
                                ? hn::Add(before, here.probability)
                                : hn::IfThenElse(hn::Gt(here.probability, hn::Set(kSoft, 0.5f)),
                                                 hn::Set(kSoft, 1.0f), before);
      hn::StoreU(after, kSoft, kept);
    });
  }
}

void ForwardAll(const SoftRasOptions& options, RowRange rows, SoftRasImage* image) {
  switch (options.distance) {
    case SoftDistance::kHard:
      return ForwardFaces<SoftDistance::kHard>(options, rows, image);
    case SoftDistance::kBarycentric:
      return ForwardFaces<SoftDistance::kBarycentric>(options, rows, image);
    case SoftDistance::kEuclidean:
      return ForwardFaces<SoftDistance::kEuclidean>(options, rows, image);
  }
}

// Where the interpolated depth is between the planes.
HWY_INLINE SoftMask LanesBetweenPlanes(const SoftRasFace& f, const SoftScale& scale,
                                       const SoftLanes& at) {
  SoftVec sum = hn::Zero(kSoft), over_z = hn::Zero(kSoft);
  for (int k = 0; k < 3; ++k) {
    const SoftVec w = hn::Min(hn::Max(at.b[k], hn::Zero(kSoft)), hn::Set(kSoft, 1.0f));
    sum = hn::Add(sum, w);
    over_z = hn::MulAdd(w, hn::Set(kSoft, 1.0f / f.z[k]), over_z);
  }
  const SoftVec z = hn::Div(sum, over_z);
  return hn::And(hn::Ge(z, hn::Set(kSoft, scale.near_plane)),
                 hn::Le(z, hn::Set(kSoft, scale.far_plane)));
}

// dL/dd, from the pixel's factor `push`.
HWY_INLINE SoftVec DistanceAdjoint(const SoftRasFace& f, const SoftRasOptions& options,
                                   const SoftScale& scale, const SoftLanes& at, SoftVec push) {
  SoftVec d_d = hn::Mul(hn::Mul(push, at.probability), hn::Set(kSoft, scale.inverse_sigma));
  if (options.alpha == SoftAlpha::kSum) {
    d_d = hn::Mul(d_d, at.miss);
  } else if (!options.exact_product) {
    const SoftVec share = hn::Mul(at.miss, hn::Set(kSoft, scale.floor_factor));
    d_d = hn::Mul(d_d, hn::Min(share, hn::Set(kSoft, 1.0f)));
  }
  if (f.may_be_beyond && !options.gradient_beyond_planes) {
    d_d = hn::IfThenElseZero(LanesBetweenPlanes(f, scale, at), d_d);
  }
  return d_d;
}

template <SoftDistance kDistance>
HWY_INLINE void BackwardFaces(const SoftRasOptions& options, const SoftRasImage& image,
                              std::size_t begin, std::size_t end, float* d_corners) {
  const SoftScale scale(options);
  for (std::size_t f = begin; f < end; ++f) {
    const SoftRasFace& face = image.faces[f];
    CornerSums sums;
    for (int k = 0; k < 3; ++k) {
      sums.x[k] = hn::Zero(kSoft);
      sums.y[k] = hn::Zero(kSoft);
    }
    ForFaceVectors(face, {0, image.size}, image,
                   [&](std::size_t at, SoftVec px, SoftVec py) HWY_ATTR {
                     const SoftLanes here = SoftFaceAt<kDistance>(face, scale, px, py);
                     const SoftVec push = hn::LoadU(kSoft, image.push.data() + at);
                     const SoftVec d_d = DistanceAdjoint(face, options, scale, here, push);
                     if constexpr (kDistance == SoftDistance::kEuclidean) {
                       AddEuclidean(here, d_d, &sums);
                     } else {
                       AddBarycentric(face, here, d_d, &sums);
                     }
                   });
    for (std::size_t k = 0; k < 3; ++k) {
      float* const out = d_corners + kCornerNumbers * f + 3 * k;
      out[0] = hn::GetLane(hn::SumOfLanes(kSoft, sums.x[k]));
      out[1] = hn::GetLane(hn::SumOfLanes(kSoft, sums.y[k]));
      out[2] = 0;
    }
  }
}

// For kEuclidean or kBarycentric.
void BackwardAll(const SoftRasOptions& options, const SoftRasImage& image, std::size_t begin,
                 std::size_t end, float* d_corners) {
  if (options.distance == SoftDistance::kEuclidean) {
    BackwardFaces<SoftDistance::kEuclidean>(options, image, begin, end, d_corners);
  } else {
    BackwardFaces<SoftDistance::kBarycentric>(options, image, begin, end, d_corners);
  }
}

}  // namespace tilegrad::rivals::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

// SPDX-License-Identifier: Apache-2.0
// Vector body of interpolate_backward.h. Lanes are faces where they are set up or finished, and the
// channels of a pixel in between.
#if defined(TILEGRAD_RASTER_INTERPOLATE_BACKWARD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_INTERPOLATE_BACKWARD_INL_H_
#undef TILEGRAD_RASTER_INTERPOLATE_BACKWARD_INL_H_
#else
#define TILEGRAD_RASTER_INTERPOLATE_BACKWARD_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstring>

#include "raster/conventions.h"
#include "raster/corner_planes-inl.h"
#include "raster/interpolate_backward.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE CornerPlanes LoadCornerPlanes(const InterpolateInput& input, const BandSums& sums,
                                         std::size_t s) {
  const LaneTag d;
  return MakeCornerPlanes(input, hn::Load(LaneIntTag(), sums.face.data() + s),
                          hn::Load(d, sums.origin_x.data() + s),
                          hn::Load(d, sums.origin_y.data() + s));
}

// Channels of a group: three, or the rest.
HWY_INLINE int GroupChannels(const InterpolateInput& input, std::size_t group) {
  return HWY_MIN(3, input.attributes.channels - 3 * static_cast<int>(group));
}

// Planes of one group for a vector of faces: N of its channels.
struct GroupPlanes {
  Lane attribute[3][3];  // [corner][channel]
  Plane numerator[3];    // [channel]
};

HWY_INLINE GroupPlanes MakeGroupPlanes(const InterpolateInput& input, const CornerPlanes& corners,
                                       std::size_t group) {
  GroupPlanes out;
  const int channels = GroupChannels(input, group);
  for (Plane& n : out.numerator) n = ZeroPlane();
  for (int k = 0; k < 3; ++k) {
    Lane a[4];
    CornerAttributes(input, corners, k, 3 * static_cast<int>(group), a);
    for (int c = 0; c < 3; ++c) {
      out.attribute[k][c] = c < channels ? a[c] : hn::Zero(LaneTag());
      AddScaled(hn::Mul(corners.m[k], out.attribute[k][c]), corners.weight[k], &out.numerator[c]);
    }
  }
  return out;
}

// Fills sums->planes and least_q.
void SetUpBand(const InterpolateInput& input, BandSums* sums) {
  const LaneTag d;
  const std::size_t stride = sums->stride();
  for (std::size_t s = 0; s < stride; s += hn::Lanes(d)) {
    const CornerPlanes corners = LoadCornerPlanes(input, *sums, s);
    hn::Store(corners.least_q, d, sums->least_q.data() + s);
    for (std::size_t g = 0; g < ChannelGroups(input.attributes.channels); ++g) {
      const GroupPlanes p = MakeGroupPlanes(input, corners, g);
      float* to = sums->planes.data() + 4 * (3 * g * stride + s);
      const Plane* n = p.numerator;
      hn::StoreInterleaved4(n[0].value, n[1].value, n[2].value, corners.q.value, d, to);
      hn::StoreInterleaved4(n[0].dx, n[1].dx, n[2].dx, corners.q.dx, d, to + 4 * stride);
      hn::StoreInterleaved4(n[0].dy, n[1].dy, n[2].dy, corners.q.dy, d, to + 8 * stride);
    }
  }
}

// Equation 3: (h_0, h_1, h_2, s) of a pixel from (g_0, g_1, g_2, 0). `planes`: of its slot.
HWY_INLINE Quad PerspectiveAdjoint(Quad d_out, const float* planes, std::size_t stride,
                                   float least_q, Quad x, Quad y) {
  const QuadTag d;
  const auto numerator =
      hn::MulAdd(hn::Load(d, planes + 4 * stride), x,
                 hn::MulAdd(hn::Load(d, planes + 8 * stride), y, hn::Load(d, planes)));
  const auto q = hn::Max(hn::Broadcast<3>(numerator), hn::Set(d, least_q));
  const auto inverse = hn::Div(hn::Set(d, 1.0f), q);
  const auto h = hn::Mul(d_out, inverse);                                     // g / Q
  const auto s = hn::SumOfLanes(d, hn::Mul(h, hn::Mul(numerator, inverse)));  // sum of h_c I_c
  return hn::IfThenElse(hn::FirstN(d, 3), h, s);
}

// Four pixels of a row, all inside the image.
struct PixelQuad {
  const std::int32_t* faces;
  Quad d_out[4];  // by pixel: (g_0, g_1, g_2, 0)
  float x, y;     // centre of the first pixel
};

// A pixel's share of the moments of its slot.
struct PixelShare {
  std::size_t slot;
  Quad f, x, y;
};

template <bool kPerspective>
HWY_INLINE PixelShare ShareOf(const PixelQuad& pixels, int p, std::size_t group, std::size_t stride,
                              const BandSums& sums) {
  const QuadTag d;
  PixelShare out;
  out.slot =
      static_cast<std::size_t>(sums.slot_of_face[static_cast<std::size_t>(1 + pixels.faces[p])]);
  out.x = hn::Set(d, pixels.x + static_cast<float>(p) - sums.origin_x[out.slot]);
  out.y = hn::Set(d, pixels.y - sums.origin_y[out.slot]);
  out.f = pixels.d_out[p];
  if (kPerspective) {
    const float* planes = sums.planes.data() + 4 * (3 * group * stride + out.slot);
    out.f = PerspectiveAdjoint(out.f, planes, stride, sums.least_q[out.slot], out.x, out.y);
  }
  return out;
}

// Neighbours mostly see the same face. So that the second need not wait for the first's store, it
// adds the first's share as well if both have the same slot, and is stored last.
HWY_INLINE void AddPair(const PixelShare& a, const PixelShare& b, float* moments,
                        std::size_t stride) {
  const QuadTag d;
  const QuadIntTag di;
  const auto same = hn::RebindMask(d, hn::Eq(hn::Set(di, static_cast<std::int32_t>(a.slot)),
                                             hn::Set(di, static_cast<std::int32_t>(b.slot))));
  const Quad again = hn::IfThenElseZero(same, a.f);
  float* to_a = moments + 4 * a.slot;
  float* to_b = moments + 4 * b.slot;
  const Quad sum = hn::Add(hn::Load(d, to_b), hn::Add(again, b.f));
  hn::Store(hn::Add(hn::Load(d, to_a), a.f), d, to_a);
  hn::Store(sum, d, to_b);
  to_a += 4 * stride;
  to_b += 4 * stride;
  const Quad sum_x = hn::MulAdd(again, a.x, hn::MulAdd(b.f, b.x, hn::Load(d, to_b)));
  hn::Store(hn::MulAdd(a.f, a.x, hn::Load(d, to_a)), d, to_a);
  hn::Store(sum_x, d, to_b);
  to_a += 4 * stride;
  to_b += 4 * stride;
  const Quad sum_y = hn::MulAdd(again, a.y, hn::MulAdd(b.f, b.y, hn::Load(d, to_b)));
  hn::Store(hn::MulAdd(a.f, a.y, hn::Load(d, to_a)), d, to_a);
  hn::Store(sum_y, d, to_b);
}

template <bool kPerspective>
HWY_INLINE void AddMoments(const PixelQuad& pixels, std::size_t group, std::size_t stride,
                           BandSums* sums) {
  float* const moments = sums->moments.data() + 12 * group * stride;
  for (int p = 0; p < kQuadPixels; p += 2) {
    AddPair(ShareOf<kPerspective>(pixels, p, group, stride, *sums),
            ShareOf<kPerspective>(pixels, p + 1, group, stride, *sums), moments, stride);
  }
}

template <bool kPerspective>
HWY_INLINE void SumRow(const InterpolateInput& input, const BackwardBand& band, int i,
                       std::size_t group, BandSums* sums) {
  const QuadTag d;
  const std::size_t stride = sums->stride();
  const std::ptrdiff_t row = i - band.rows.row_begin;
  const std::int32_t* const faces = band.rows.row(i);
  const int channels = GroupChannels(input, group);
  const float* const d_row = band.d_out.data +
                             3 * static_cast<std::ptrdiff_t>(group) * band.d_out.plane +
                             row * band.d_out.row;
  const float y = static_cast<float>(i) + 0.5f;
  const auto add = [&](PixelQuad* pixels) HWY_ATTR {
    Transpose(d, pixels->d_out);
    AddMoments<kPerspective>(*pixels, group, stride, sums);
  };
  int j = 0;
  for (; j + kQuadPixels <= band.rows.width; j += kQuadPixels) {
    if (hn::AllFalse(d, SeesFace(faces + j))) continue;
    PixelQuad pixels{faces + j, {}, static_cast<float>(band.rows.x0 + j) + 0.5f, y};
    for (int c = 0; c < 4; ++c) {
      pixels.d_out[c] = c < channels ? hn::LoadU(d, d_row + c * band.d_out.plane + j) : hn::Zero(d);
    }
    add(&pixels);
  }
  if (j == band.rows.width) return;
  std::int32_t last[kQuadPixels] = {kNoFace, kNoFace, kNoFace, kNoFace};
  const auto rest = static_cast<std::size_t>(band.rows.width - j);
  std::memcpy(last, faces + j, rest * sizeof(last[0]));
  PixelQuad pixels{last, {}, static_cast<float>(band.rows.x0 + j) + 0.5f, y};
  for (int c = 0; c < 4; ++c) {
    HWY_ALIGN float values[kQuadPixels] = {};
    if (c < channels) {
      std::memcpy(values, d_row + c * band.d_out.plane + j, rest * sizeof(values[0]));
    }
    pixels.d_out[c] = hn::Load(d, values);
  }
  add(&pixels);
}

void SumMoments(const InterpolateInput& input, const BackwardBand& band, BandSums* sums) {
  const std::size_t groups = ChannelGroups(input.attributes.channels);
  const bool perspective = input.mode == Interpolation::kPerspective;
  std::memset(sums->moments.data(), 0, 12 * groups * sums->stride() * sizeof(float));
  if (perspective) SetUpBand(input, sums);
  for (int i = band.rows.row_begin; i < band.rows.row_end; ++i) {
    for (std::size_t g = 0; g < groups; ++g) {
      if (perspective) {
        SumRow<true>(input, band, i, g, sums);
      } else {
        SumRow<false>(input, band, i, g, sums);
      }
    }
  }
}

// S_k of a group (equation 4: sums over pixels), [corner][channel or s], for a vector of faces.
struct GroupSums {
  Lane sum[3][4];
};

HWY_INLINE GroupSums LoadGroupSums(const CornerPlanes& corners, const float* moments,
                                   std::size_t stride) {
  const LaneTag d;
  Lane m[3][4];
  for (std::size_t part = 0; part < 3; ++part) {
    hn::LoadInterleaved4(d, moments + 4 * part * stride, m[part][0], m[part][1], m[part][2],
                         m[part][3]);
  }
  GroupSums out;
  for (int k = 0; k < 3; ++k) {
    const Plane& w = corners.weight[k];
    for (int c = 0; c < 4; ++c) {
      out.sum[k][c] =
          hn::MulAdd(w.value, m[0][c], hn::MulAdd(w.dx, m[1][c], hn::Mul(w.dy, m[2][c])));
    }
  }
  return out;
}

// Gradients of a vector of faces' corners.
struct CornerAdjoints {
  Lane d_x[3], d_y[3], d_m[3];
};

// Adds the share of one group: d_v_k and d_m_k of interpolate.h (equation 4).
HWY_INLINE void AddGroup(const GroupPlanes& planes, const Plane& q, const GroupSums& sums,
                         bool perspective, CornerAdjoints* out) {
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < 3; ++c) {
      out->d_x[k] = hn::NegMulAdd(planes.numerator[c].dx, sums.sum[k][c], out->d_x[k]);  // (4)
      out->d_y[k] = hn::NegMulAdd(planes.numerator[c].dy, sums.sum[k][c], out->d_y[k]);  // (4)
    }
    if (!perspective) continue;  // Q is constant, and so is m
    out->d_x[k] = hn::MulAdd(q.dx, sums.sum[k][3], out->d_x[k]);
    out->d_y[k] = hn::MulAdd(q.dy, sums.sum[k][3], out->d_y[k]);
    out->d_m[k] = hn::Sub(out->d_m[k], sums.sum[k][3]);
    for (int c = 0; c < 3; ++c) {
      out->d_m[k] = hn::MulAdd(planes.attribute[k][c], sums.sum[k][c], out->d_m[k]);
    }
  }
}

// One vector of slots from `s` on; `to`: its position in the first array.
HWY_INLINE void FinishLanes(const InterpolateInput& input, const BandSums& sums, std::size_t s,
                            const BackwardRequest& request, float* to) {
  const LaneTag d;
  const auto zero = hn::Zero(d);
  const std::size_t stride = sums.stride(), groups = ChannelGroups(input.attributes.channels);
  const CornerPlanes corners = LoadCornerPlanes(input, sums, s);
  CornerAdjoints adjoints;
  for (int k = 0; k < 3; ++k) adjoints.d_x[k] = adjoints.d_y[k] = adjoints.d_m[k] = zero;
  float* attribute = to + (request.geometry ? 12 * stride : 0);
  for (std::size_t g = 0; g < groups; ++g) {
    const GroupSums group =
        LoadGroupSums(corners, sums.moments.data() + 4 * (3 * g * stride + s), stride);
    if (request.geometry) {
      AddGroup(MakeGroupPlanes(input, corners, g), corners.q, group,
               input.mode == Interpolation::kPerspective, &adjoints);
    }
    for (int k = 0; k < 3 && request.attributes; ++k, attribute += 4 * stride) {
      const auto m = corners.m[k];
      hn::StoreInterleaved4(hn::Mul(m, group.sum[k][0]), hn::Mul(m, group.sum[k][1]),
                            hn::Mul(m, group.sum[k][2]), zero, d, attribute);
    }
  }
  for (int k = 0; k < 3 && request.geometry; ++k, to += 4 * stride) {
    const auto d_inverse_depth = hn::Mul(adjoints.d_m[k], corners.scale);
    hn::StoreInterleaved4(adjoints.d_x[k], adjoints.d_y[k], d_inverse_depth, zero, d, to);
  }
}

void Finish(const InterpolateInput& input, const BandSums& sums, const BackwardRequest& request,
            float* d_faces) {
  const std::size_t lanes = hn::Lanes(LaneTag());
  for (std::size_t s = 0; s < sums.stride(); s += lanes) {
    if (s + lanes < sums.stride()) PrefetchCorners(*input.mesh, sums.face.data() + s + lanes);
    FinishLanes(input, sums, s, request, d_faces + 4 * s);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

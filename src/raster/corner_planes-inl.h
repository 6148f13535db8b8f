// SPDX-License-Identifier: Apache-2.0
// Faces as planes, vectorised: shared by interpolate.h and interpolate_backward.h.
#if defined(TILEGRAD_RASTER_CORNER_PLANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_CORNER_PLANES_INL_H_
#undef TILEGRAD_RASTER_CORNER_PLANES_INL_H_
#else
#define TILEGRAD_RASTER_CORNER_PLANES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/prefetch.h"
#include "raster/face_lanes-inl.h"
#include "raster/face_plane.h"
#include "raster/interpolate.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Lanes are faces.
using LaneTag = FaceTag;
using LaneIntTag = FaceIntTag;
using Lane = FaceVec;
using LaneInt = FaceInt;

// value + dx * x + dy * y
struct Plane {
  Lane value, dx, dy;
};

HWY_INLINE void AddScaled(Lane scale, const Plane& p, Plane* sum) {
  sum->value = hn::MulAdd(scale, p.value, sum->value);
  sum->dx = hn::MulAdd(scale, p.dx, sum->dx);
  sum->dy = hn::MulAdd(scale, p.dy, sum->dy);
}

HWY_INLINE Plane ZeroPlane() {
  const LaneTag d;
  return {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
}

// Indices by lane and corner. Scalars, not vectors: a vector load would stall on the stores before
// it.
struct CornerIndices {
  std::int32_t at[3][kMostFaceLanes];
};

HWY_INLINE CornerIndices VerticesOf(const ScreenMesh& mesh, const std::int32_t* faces) {
  const std::int32_t* const corners[3] = {mesh.v0.data(), mesh.v1.data(), mesh.v2.data()};
  CornerIndices out;
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < hn::Lanes(LaneIntTag()); ++i) out.at[k][i] = corners[k][faces[i]];
  }
  return out;
}

// Prefetches the vertices of a vector of faces.
HWY_INLINE void PrefetchCorners(const ScreenMesh& mesh, const std::int32_t* faces) {
  const CornerIndices vertices = VerticesOf(mesh, faces);
  for (const auto& corner : vertices.at) {
    for (std::size_t i = 0; i < hn::Lanes(LaneIntTag()); ++i) {
      PrefetchLine(&mesh.packed[static_cast<std::size_t>(corner[i])]);
    }
  }
}

struct CornerLanes {
  Lane x[3], y[3], inverse_depth[3];
};

HWY_INLINE CornerLanes LoadCorners(const ScreenMesh& mesh, const CornerIndices& vertices) {
  CornerLanes out;
  for (int k = 0; k < 3; ++k) {
    Lane v[4];
    LoadVertices(mesh, vertices.at[k], v);
    out.x[k] = v[0];
    out.y[k] = v[1];
    out.inverse_depth[k] = v[2];
  }
  return out;
}

// Barycentric weights as planes (equation 2): MakeFacePlane of face_plane.h. Returns the squares of
// the longest edges.
HWY_INLINE Lane WeightPlanes(const CornerLanes& c, Lane origin_x, Lane origin_y, Plane out[3]) {
  const LaneTag d;
  const auto x1 = hn::Sub(c.x[1], c.x[0]), y1 = hn::Sub(c.y[1], c.y[0]);
  const auto x2 = hn::Sub(c.x[2], c.x[0]), y2 = hn::Sub(c.y[2], c.y[0]);
  const auto x3 = hn::Sub(x2, x1), y3 = hn::Sub(y2, y1);
  const auto area = hn::Sub(hn::Mul(x1, y2), hn::Mul(x2, y1));
  const auto longest =
      hn::Max(hn::Max(hn::MulAdd(x1, x1, hn::Mul(y1, y1)), hn::MulAdd(x2, x2, hn::Mul(y2, y2))),
              hn::MulAdd(x3, x3, hn::Mul(y3, y3)));
  constexpr auto kThin = static_cast<float>(kFlatHeight * kFlatHeight);
  constexpr auto kLong = static_cast<float>(kFlatLength * kFlatLength);
  const auto solid = hn::And(hn::Gt(hn::Mul(area, area), hn::Mul(hn::Set(d, kThin), longest)),
                             hn::Lt(longest, hn::Set(d, kLong)));
  const auto inverse = hn::IfThenElseZero(solid, hn::Div(hn::Set(d, 1.0f), area));
  const auto x = hn::Sub(origin_x, c.x[0]), y = hn::Sub(origin_y, c.y[0]);
  const auto third = hn::IfThenZeroElse(solid, hn::Set(d, 1.0f / 3.0f));
  out[1].dx = hn::Mul(y2, inverse);
  out[1].dy = hn::Neg(hn::Mul(x2, inverse));
  out[2].dx = hn::Neg(hn::Mul(y1, inverse));
  out[2].dy = hn::Mul(x1, inverse);
  for (int k = 1; k < 3; ++k) {
    out[k].value = hn::MulAdd(out[k].dx, x, hn::MulAdd(out[k].dy, y, third));
  }
  out[0].value = hn::Sub(hn::Set(d, 1.0f), hn::Add(out[1].value, out[2].value));
  out[0].dx = hn::Neg(hn::Add(out[1].dx, out[2].dx));
  out[0].dy = hn::Neg(hn::Add(out[1].dy, out[2].dy));
  return longest;
}

// Faces that are set up in double. Steep ones: perspective attributes of their far end are the
// quotient of two small differences of large terms, which float rounding at the near end would
// swamp. In either mode the near corners have small weights there but move far on the screen with
// their vertices, so the gradient needs the digits of small weights. Long ones: a
// plane starts at a corner, and the farther that lies outside of the image, the more digits float
// loses.
HWY_INLINE hn::Mask<LaneTag> NeedDouble(const Lane (&inverse_depth)[3], Lane longest_squared) {
  const LaneTag d;
  const auto& z = inverse_depth;
  const auto least = hn::Min(hn::Min(z[0], z[1]), z[2]);
  const auto largest = hn::Max(hn::Max(z[0], z[1]), z[2]);
  const auto steep = hn::Lt(hn::Mul(least, hn::Set(d, kSteepDepth)), largest);
  return hn::Or(steep, hn::Gt(longest_squared, hn::Set(d, kGuardBand * kGuardBand)));
}

struct WeightLanes {
  float value[kMostFaceLanes], dx[kMostFaceLanes], dy[kMostFaceLanes];
};

// Recomputes WeightPlanes for the lanes in `which`.
inline HWY_NOINLINE void SetWeightsInDouble(const CornerLanes& c, Lane origin_x, Lane origin_y,
                                            hn::Mask<LaneTag> which, Plane out[3]) {
  const LaneTag d;
  HWY_ALIGN float x[3][kMostFaceLanes], y[3][kMostFaceLanes], z[3][kMostFaceLanes];
  HWY_ALIGN float origin[2][kMostFaceLanes];
  HWY_ALIGN WeightLanes lanes[3];
  hn::Store(origin_x, d, origin[0]);
  hn::Store(origin_y, d, origin[1]);
  for (int k = 0; k < 3; ++k) {
    hn::Store(c.x[k], d, x[k]);
    hn::Store(c.y[k], d, y[k]);
    hn::Store(c.inverse_depth[k], d, z[k]);
    hn::Store(out[k].value, d, lanes[k].value);
    hn::Store(out[k].dx, d, lanes[k].dx);
    hn::Store(out[k].dy, d, lanes[k].dy);
  }
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, which, bits);
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
    if ((bits[i / 8] >> i % 8 & 1) == 0) continue;
    // Flat, since thin or too large to decide in float: stays so where Q, in which the far corner
    // counts least / largest, would be 0 or lose its digits to underflow (1e-38).
    const auto [least, largest] = std::minmax({z[0][i], z[1][i], z[2][i]});
    const bool is_flat = lanes[1].dx[i] == 0 && lanes[1].dy[i] == 0;
    if (is_flat && least < largest * 1e-30f) continue;
    const FacePlane<double> plane = MakeFacePlane(ScreenCorners<double>{
        {x[0][i], x[1][i], x[2][i]}, {y[0][i], y[1][i], y[2][i]}, {z[0][i], z[1][i], z[2][i]}});
    const auto value = plane.Weights(origin[0][i], origin[1][i]);
    for (std::size_t k = 0; k < 3; ++k) {
      lanes[k].value[i] = static_cast<float>(value[k]);
      lanes[k].dx[i] = static_cast<float>(plane.gx[k]);
      lanes[k].dy[i] = static_cast<float>(plane.gy[k]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    out[k] = {hn::Load(d, lanes[k].value), hn::Load(d, lanes[k].dx), hn::Load(d, lanes[k].dy)};
  }
}

// Offsets of the corners' attributes.
HWY_INLINE CornerIndices AttributesAt(const InterpolateInput& input, const std::int32_t* faces,
                                      const CornerIndices& vertices) {
  const bool by_vertex = input.attributes.rate == Rate::kVertex;
  CornerIndices out;
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < hn::Lanes(LaneIntTag()); ++i) {
      const std::int32_t row = by_vertex ? vertices.at[k][i] : 3 * faces[i] + k;
      out.at[k][i] = row * input.attributes.channels;
    }
  }
  return out;
}

// The inputs from which the planes of a vector of faces are built.
struct CornerPlanes {
  Plane weight[3], q;
  Lane m[3];   // 1/depth times `scale`, or 1
  Lane scale;  // normalises the largest m to 1: N and Q stay in range whatever the unit of depth
  Lane least_q;
  CornerIndices attributes;
};

// LeastQ of face_plane.h.
HWY_INLINE Lane LeastQ(const CornerPlanes& corners) {
  const auto least = hn::Min(hn::Min(corners.m[0], corners.m[1]), corners.m[2]);
  auto change = hn::Zero(LaneTag());
  for (int k = 0; k < 3; ++k) {
    const Plane& w = corners.weight[k];
    change = hn::MulAdd(corners.m[k], hn::Add(hn::Abs(w.dx), hn::Abs(w.dy)), change);
  }
  return hn::Max(least, hn::Mul(change, hn::Set(LaneTag(), static_cast<float>(kSnapError))));
}

// Planes in terms of the position relative to an origin.
HWY_INLINE CornerPlanes MakeCornerPlanes(const InterpolateInput& input, LaneInt face, Lane origin_x,
                                         Lane origin_y) {
  const LaneTag d;
  HWY_ALIGN std::int32_t faces[kMostFaceLanes];
  hn::Store(face, LaneIntTag(), faces);
  const CornerIndices vertices = VerticesOf(*input.mesh, faces);
  const CornerLanes corners = LoadCorners(*input.mesh, vertices);
  CornerPlanes out;
  out.attributes = AttributesAt(input, faces, vertices);
  out.q = ZeroPlane();
  const auto longest_squared = WeightPlanes(corners, origin_x, origin_y, out.weight);
  const auto one = hn::Set(d, 1.0f);
  const auto& z = corners.inverse_depth;
  const bool perspective = input.mode == Interpolation::kPerspective;
  out.scale = perspective ? hn::Div(one, hn::Max(hn::Max(z[0], z[1]), z[2])) : one;
  for (int k = 0; k < 3; ++k) out.m[k] = perspective ? hn::Mul(z[k], out.scale) : one;
  const auto in_double = NeedDouble(z, longest_squared);
  if (HWY_UNLIKELY(!hn::AllFalse(d, in_double))) {
    SetWeightsInDouble(corners, origin_x, origin_y, in_double, out.weight);
  }
  out.least_q = LeastQ(out);
  for (int k = 0; k < 3; ++k) AddScaled(out.m[k], out.weight[k], &out.q);
  return out;
}

// Four attributes per lane, starting at a channel; fewer at the end of the array.
class AttributeQuads {
 public:
  HWY_INLINE AttributeQuads(std::span<const float> values, const std::int32_t* row, int first)
      : values_(values), row_(row), first_(first) {}

  HWY_INLINE const float* operator()(std::size_t lane) const {
    const auto at = static_cast<std::size_t>(row_[lane] + first_);
    if (at + 4 <= values_.size()) return values_.data() + at;
    std::memcpy(last_, values_.data() + at, (values_.size() - at) * sizeof(float));
    return last_;
  }

 private:
  std::span<const float> values_;
  const std::int32_t* row_;
  int first_;
  mutable float last_[4] = {};
};

// Channels `first` to first + 3 at corner k; missing channels hold any finite number.
HWY_INLINE void CornerAttributes(const InterpolateInput& input, const CornerPlanes& corners, int k,
                                 int first, Lane (&out)[4]) {
  LoadQuads(LaneTag(), AttributeQuads(input.attributes.values, corners.attributes.at[k], first),
            out);
}

inline constexpr int kQuadPixels = 4;

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

// SPDX-License-Identifier: Apache-2.0
// Vector body of interpolate.h. Lanes are slots (faces) where faces are set up or finished, and
// pixels of a row in between.
#if defined(TILEGRAD_RASTER_INTERPOLATE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_INTERPOLATE_INL_H_
#undef TILEGRAD_RASTER_INTERPOLATE_INL_H_
#else
#define TILEGRAD_RASTER_INTERPOLATE_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstring>
#include <limits>

#include "raster/interpolate.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using LaneTag = HWY_CAPPED(float, kTileSize);
using LaneIntTag = hn::RebindToSigned<LaneTag>;
using Lane = hn::Vec<LaneTag>;
using LaneInt = hn::Vec<LaneIntTag>;

// value + dx * x + dy * y
struct Plane {
  Lane value, dx, dy;
};

HWY_INLINE void StorePlane(const Plane& p, float* to) {
  const LaneTag d;
  hn::Store(p.value, d, to);
  hn::Store(p.dx, d, to + kTilePixels);
  hn::Store(p.dy, d, to + 2 * kTilePixels);
}

HWY_INLINE Plane LoadPlane(const float* from) {
  const LaneTag d;
  return {hn::Load(d, from), hn::Load(d, from + kTilePixels), hn::Load(d, from + 2 * kTilePixels)};
}

HWY_INLINE void AddScaled(Lane scale, const Plane& p, Plane* sum) {
  sum->value = hn::MulAdd(scale, p.value, sum->value);
  sum->dx = hn::MulAdd(scale, p.dx, sum->dx);
  sum->dy = hn::MulAdd(scale, p.dy, sum->dy);
}

HWY_INLINE Plane ZeroPlane() {
  const LaneTag d;
  return {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
}

// The plane at each lane's slot, evaluated at (x, y) from the slot's origin.
HWY_INLINE Lane EvaluatePlane(const float* planes, LaneInt slot, Lane x, Lane y) {
  const LaneTag d;
  const auto value = hn::GatherIndex(d, planes, slot);
  const auto dx = hn::GatherIndex(d, planes + kTilePixels, slot);
  const auto dy = hn::GatherIndex(d, planes + 2 * kTilePixels, slot);
  return hn::MulAdd(dx, x, hn::MulAdd(dy, y, value));
}

struct CornerLanes {
  LaneInt vertex[3];
  Lane x[3], y[3];
};

HWY_INLINE CornerLanes GatherCorners(const ScreenMesh& mesh, LaneInt face) {
  const LaneTag d;
  const LaneIntTag di;
  CornerLanes out;
  const std::int32_t* const corners[3] = {mesh.v0.data(), mesh.v1.data(), mesh.v2.data()};
  for (int k = 0; k < 3; ++k) {
    out.vertex[k] = hn::GatherIndex(di, corners[k], face);
    out.x[k] = hn::GatherIndex(d, mesh.x.data(), out.vertex[k]);
    out.y[k] = hn::GatherIndex(d, mesh.y.data(), out.vertex[k]);
  }
  return out;
}

// Barycentric weights as planes: MakeFacePlane of face_plane.h.
HWY_INLINE void WeightPlanes(const CornerLanes& c, Lane origin_x, Lane origin_y, Plane out[3]) {
  const LaneTag d;
  const auto x1 = hn::Sub(c.x[1], c.x[0]), y1 = hn::Sub(c.y[1], c.y[0]);
  const auto x2 = hn::Sub(c.x[2], c.x[0]), y2 = hn::Sub(c.y[2], c.y[0]);
  const auto x3 = hn::Sub(x2, x1), y3 = hn::Sub(y2, y1);
  const auto area = hn::Sub(hn::Mul(x1, y2), hn::Mul(x2, y1));
  const auto longest =
      hn::Max(hn::Max(hn::MulAdd(x1, x1, hn::Mul(y1, y1)), hn::MulAdd(x2, x2, hn::Mul(y2, y2))),
              hn::MulAdd(x3, x3, hn::Mul(y3, y3)));
  constexpr auto kThin = static_cast<float>(kFlatHeight * kFlatHeight);
  const auto solid = hn::Gt(hn::Mul(area, area), hn::Mul(hn::Set(d, kThin), longest));
  const auto inverse = hn::IfThenElseZero(solid, hn::Div(hn::Set(d, 1.0f), area));
  const auto x = hn::Sub(origin_x, c.x[0]), y = hn::Sub(origin_y, c.y[0]);
  const auto third = hn::IfThenZeroElse(solid, hn::Set(d, 1.0f / 3.0f));
  out[1].dx = hn::Mul(y2, inverse), out[1].dy = hn::Neg(hn::Mul(x2, inverse));
  out[2].dx = hn::Neg(hn::Mul(y1, inverse)), out[2].dy = hn::Mul(x1, inverse);
  for (int k = 1; k < 3; ++k) {
    out[k].value = hn::MulAdd(out[k].dx, x, hn::MulAdd(out[k].dy, y, third));
  }
  out[0].value = hn::Sub(hn::Set(d, 1.0f), hn::Add(out[1].value, out[2].value));
  out[0].dx = hn::Neg(hn::Add(out[1].dx, out[2].dx));
  out[0].dy = hn::Neg(hn::Add(out[1].dy, out[2].dy));
}

// Index of a corner's first attribute.
HWY_INLINE LaneInt AttributeRow(const InterpolateInput& input, LaneInt face, LaneInt vertex,
                                int k) {
  const LaneIntTag di;
  const auto row = input.attributes.rate == AttributeRate::kVertex
                       ? vertex
                       : hn::Add(hn::Mul(face, hn::Set(di, 3)), hn::Set(di, k));
  return hn::Mul(row, hn::Set(di, input.attributes.channels));
}

// What the planes of one vector of slots are made of.
struct CornerPlanes {
  Plane weight[3], q;
  Lane m[3];
  LaneInt row[3];
};

HWY_INLINE CornerPlanes MakeCornerPlanes(const InterpolateInput& input, const TileFaces& faces,
                                         std::size_t s) {
  const LaneTag d;
  const LaneIntTag di;
  const auto face = hn::Load(di, faces.face + s);
  const CornerLanes corners = GatherCorners(*input.mesh, face);
  CornerPlanes out;
  out.q = ZeroPlane();
  WeightPlanes(corners, hn::Load(d, faces.origin_x + s), hn::Load(d, faces.origin_y + s),
               out.weight);
  for (int k = 0; k < 3; ++k) {
    out.m[k] = input.mode == Interpolation::kPerspective
                   ? hn::GatherIndex(d, input.mesh->inverse_depth.data(), corners.vertex[k])
                   : hn::Set(d, 1.0f);
    out.row[k] = AttributeRow(input, face, corners.vertex[k], k);
    AddScaled(out.m[k], out.weight[k], &out.q);
  }
  return out;
}

// N of an output: a channel, or the barycentric of corner 1 or 2.
HWY_INLINE Plane NumeratorPlane(const InterpolateInput& input, const CornerPlanes& corners,
                                int output) {
  const LaneTag d;
  const int channels = input.attributes.channels;
  Plane n = ZeroPlane();
  if (output >= channels) {
    const int k = output - channels + 1;
    AddScaled(corners.m[k], corners.weight[k], &n);
    return n;
  }
  for (int k = 0; k < 3; ++k) {
    const auto a = hn::GatherIndex(d, input.attributes.values.data() + output, corners.row[k]);
    AddScaled(hn::Mul(corners.m[k], a), corners.weight[k], &n);
  }
  return n;
}

HWY_INLINE Lane LeastQ(const CornerPlanes& corners) {
  return hn::Min(hn::Min(corners.m[0], corners.m[1]), corners.m[2]);
}

// One vector of slots, from `s` on.
HWY_INLINE void SetUpLanes(const InterpolateInput& input, const TileFaces& faces, std::size_t s,
                           TilePlanes* planes) {
  const LaneTag d;
  const LaneIntTag di;
  const CornerPlanes corners = MakeCornerPlanes(input, faces, s);
  for (int k = 0; k < 3; ++k) {
    StorePlane(corners.weight[k], planes->weight(k) + s);
    hn::Store(corners.m[k], d, planes->m(k) + s);
    hn::Store(corners.row[k], di, planes->row(k) + s);
  }
  StorePlane(corners.q, planes->q() + s);
  hn::Store(LeastQ(corners), d, planes->least_q() + s);
  for (int o = 0; o < planes->outputs(); ++o) {
    StorePlane(NumeratorPlane(input, corners, o), planes->numerator(o) + s);
  }
}

void SetUpPlanes(const InterpolateInput& input, const TileFaces& faces, TilePlanes* planes) {
  const LaneTag d;
  for (std::size_t s = 0; s < static_cast<std::size_t>(faces.count); s += hn::Lanes(d)) {
    SetUpLanes(input, faces, s, planes);
  }
}

// Where a vector of pixels lies: slot (0 at background), position from its origin, 1 / Q.
struct PixelLanes {
  LaneInt slot;
  hn::Mask<LaneTag> seen;
  Lane x, y, inverse_q;
};

HWY_INLINE PixelLanes LocatePixels(const InterpolateInput& input, const TileFaces& faces,
                                   const TileRect& rect, int i, int j, TilePlanes* planes) {
  const LaneTag d;
  const LaneIntTag di;
  PixelLanes out;
  const auto slot = hn::Load(di, faces.slot + i * kTileSize + j);
  out.seen = hn::RebindMask(d, hn::Gt(slot, hn::Set(di, -1)));
  out.slot = hn::Max(slot, hn::Zero(di));
  const auto px = hn::Iota(d, static_cast<float>(rect.x0 + j) + 0.5f);
  const auto py = hn::Set(d, static_cast<float>(rect.y0 + i) + 0.5f);
  out.x = hn::Sub(px, hn::GatherIndex(d, faces.origin_x, out.slot));
  out.y = hn::Sub(py, hn::GatherIndex(d, faces.origin_y, out.slot));
  out.inverse_q = hn::Set(d, 1.0f);
  if (input.mode == Interpolation::kPerspective) {
    const auto q = hn::Max(EvaluatePlane(planes->q(), out.slot, out.x, out.y),
                           hn::GatherIndex(d, planes->least_q(), out.slot));
    out.inverse_q = hn::Div(hn::Set(d, 1.0f), q);
  }
  return out;
}

HWY_INLINE Lane LoadFirst(const float* from, std::size_t count) {
  const LaneTag d;
  if (count >= hn::Lanes(d)) return hn::LoadU(d, from);
  HWY_ALIGN float lanes[kTileSize] = {};
  std::memcpy(lanes, from, count * sizeof(float));
  return hn::Load(d, lanes);
}

// Where an output stands: group 0 has three outputs and Q.
HWY_INLINE int FirstOutput(int group) { return group == 0 ? 0 : 4 * group - 1; }
HWY_INLINE int GroupOutputs(int group) { return group == 0 ? 3 : 4; }

// One vector of slots of a group.
HWY_INLINE void StoreQuads(const Plane (&p)[4], int group, std::size_t s, TileQuads* quads) {
  const LaneTag d;
  const auto store = [&](Lane a, Lane b, Lane c, Lane e, int part) HWY_ATTR {
    hn::StoreInterleaved4(a, b, c, e, d, quads->quads(group, part) + 4 * s);
  };
  store(p[0].value, p[1].value, p[2].value, p[3].value, 0);
  store(p[0].dx, p[1].dx, p[2].dx, p[3].dx, 1);
  store(p[0].dy, p[1].dy, p[2].dy, p[3].dy, 2);
}

HWY_INLINE void SetUpQuads(const InterpolateInput& input, const TileFaces& faces, int outputs,
                           TileQuads* quads) {
  const LaneTag d;
  const auto lowest = hn::Set(d, -std::numeric_limits<float>::max());
  for (std::size_t s = 0; s < static_cast<std::size_t>(faces.count); s += hn::Lanes(d)) {
    const CornerPlanes corners = MakeCornerPlanes(input, faces, s);
    hn::StoreInterleaved4(lowest, lowest, lowest, LeastQ(corners), d, quads->least() + 4 * s);
    for (int g = 0; g < quads->groups(); ++g) {
      Plane planes[4];
      planes[3] = corners.q;
      for (int i = 0; i < GroupOutputs(g); ++i) {
        const int o = FirstOutput(g) + i;
        planes[i] = o < outputs ? NumeratorPlane(input, corners, o) : ZeroPlane();
      }
      StoreQuads(planes, g, s, quads);
    }
  }
}

inline constexpr int kQuadPixels = 4;
using QuadTag = hn::FixedTag<float, kQuadPixels>;
using Quad = hn::Vec<QuadTag>;

// From four outputs of four pixels to four pixels of four outputs, in place.
HWY_INLINE void Transpose(Quad (&q)[4]) {
  const QuadTag d;
  const Quad a = hn::InterleaveLower(d, q[0], q[2]), b = hn::InterleaveLower(d, q[1], q[3]);
  const Quad e = hn::InterleaveUpper(d, q[0], q[2]), f = hn::InterleaveUpper(d, q[1], q[3]);
  q[0] = hn::InterleaveLower(d, a, b), q[1] = hn::InterleaveUpper(d, a, b);
  q[2] = hn::InterleaveLower(d, e, f), q[3] = hn::InterleaveUpper(d, e, f);
}

// Four pixels of a row: where their faces' quads are, and where they lie from the faces' origins.
struct QuadPixels {
  std::size_t at[kQuadPixels];
  Quad x[kQuadPixels], y[kQuadPixels];
  hn::Mask<QuadTag> seen;

  HWY_INLINE QuadPixels(const TileFaces& faces, const TileRect& rect, int i, int j) {
    const QuadTag d;
    const hn::RebindToSigned<QuadTag> di;
    const std::int32_t* slots = faces.slot + i * kTileSize + j;
    seen = hn::RebindMask(d, hn::Gt(hn::LoadU(di, slots), hn::Set(di, -1)));
    const float px = static_cast<float>(rect.x0 + j) + 0.5f;
    const auto py = hn::Set(d, static_cast<float>(rect.y0 + i) + 0.5f);
    for (int p = 0; p < kQuadPixels; ++p) {
      const auto slot = static_cast<std::size_t>(HWY_MAX(slots[p], 0));
      at[p] = 4 * slot;
      x[p] = hn::Sub(hn::Set(d, px + static_cast<float>(p)), hn::Set(d, faces.origin_x[slot]));
      y[p] = hn::Sub(py, hn::Set(d, faces.origin_y[slot]));
    }
  }

  // The four planes of a group at the four pixels, as planes.
  HWY_INLINE void Evaluate(TileQuads* quads, int group, Quad (&out)[4]) const {
    const QuadTag d;
    const float *value = quads->quads(group, 0), *dx = quads->quads(group, 1);
    const float* dy = quads->quads(group, 2);
    for (int p = 0; p < kQuadPixels; ++p) {
      out[p] = hn::MulAdd(hn::Load(d, dx + at[p]), x[p],
                          hn::MulAdd(hn::Load(d, dy + at[p]), y[p], hn::Load(d, value + at[p])));
      if (group == 0) out[p] = hn::Max(out[p], hn::Load(d, quads->least() + at[p]));
    }
    Transpose(out);
  }
};

// What the pixels of a tile are made of and where they go.
struct InterpolateJob {
  const InterpolateInput& input;
  const TileFaces& faces;
  const TileRect& rect;
  const InterpolateOutput& out;
  int outputs;
  TileQuads* quads;
};

// One row of the outputs of a group.
struct QuadRow {
  float* to[4];  // the row's pixels of each output
  int outputs;   // how many there are
  int count;     // pixels

  HWY_INLINE QuadRow(const InterpolateJob& job, int group, int i) {
    const int first = FirstOutput(group), channels = job.input.attributes.channels;
    outputs = HWY_MIN(GroupOutputs(group), job.outputs - first);
    count = job.rect.x1 - job.rect.x0;
    for (int k = 0; k < outputs; ++k) {
      const int o = first + k;
      const auto& view = o < channels ? job.out.attributes : job.out.barycentrics;
      to[k] = view.data + (o < channels ? o : o - channels) * view.plane + i * view.row;
    }
  }
  HWY_INLINE void Store(int k, int j, Quad v) const {
    const QuadTag d;
    if (j + kQuadPixels <= count) {
      hn::StoreU(v, d, to[k] + j);
      return;
    }
    HWY_ALIGN float lanes[kQuadPixels];
    hn::Store(v, d, lanes);
    std::memcpy(to[k] + j, lanes, static_cast<std::size_t>(count - j) * sizeof(float));
  }
};

// One row of a group. inverse_q [kTileSize] of the row is set by group 0, for the others.
template <bool kPerspective>
HWY_INLINE void InterpolateRow(const InterpolateJob& job, int group, int i, float* inverse_q) {
  const QuadTag d;
  const hn::RebindToSigned<QuadTag> di;
  const QuadRow row(job, group, i);
  for (int j = 0; j < row.count; j += kQuadPixels) {
    const auto slots = hn::Load(di, job.faces.slot + i * kTileSize + j);
    if (hn::AllTrue(di, hn::Lt(slots, hn::Zero(di)))) {
      for (int k = 0; k < row.outputs; ++k) row.Store(k, j, hn::Zero(d));
      continue;
    }
    const QuadPixels pixels(job.faces, job.rect, i, j);
    Quad values[4];
    pixels.Evaluate(job.quads, group, values);
    auto scale = hn::Set(d, 1.0f);
    if (kPerspective && group == 0) hn::Store(hn::Div(scale, values[3]), d, inverse_q + j);
    if (kPerspective) scale = hn::Load(d, inverse_q + j);
    for (int k = 0; k < row.outputs; ++k) {
      const auto value = kPerspective ? hn::Mul(values[k], scale) : values[k];
      row.Store(k, j, hn::IfThenElseZero(pixels.seen, value));
    }
  }
}

template <bool kPerspective>
HWY_INLINE void InterpolateRows(const InterpolateJob& job) {
  for (int i = 0; i < job.rect.y1 - job.rect.y0; ++i) {
    HWY_ALIGN float inverse_q[kTileSize];
    for (int g = 0; g < job.quads->groups(); ++g) {
      InterpolateRow<kPerspective>(job, g, i, inverse_q);
    }
  }
}

void Interpolate(const InterpolateInput& input, const TileFaces& faces, const TileRect& rect,
                 TileQuads* quads, const InterpolateOutput& out) {
  const InterpolateJob job{input, faces, rect, out, InterpolateOutputs(input), quads};
  SetUpQuads(input, faces, job.outputs, quads);
  if (input.mode == Interpolation::kPerspective) {
    InterpolateRows<true>(job);
  } else {
    InterpolateRows<false>(job);
  }
}

// h_c and s of every pixel of the tile; 0 where nothing is seen.
void PixelAdjoints(const InterpolateInput& input, const TileFaces& faces, const TileRect& rect,
                   const PlanarView<const float>& d_out, TilePlanes* planes) {
  const LaneTag d;
  const int lanes = static_cast<int>(hn::Lanes(d)), width = rect.x1 - rect.x0;
  const int channels = planes->channels();
  for (int i = 0; i < rect.y1 - rect.y0; ++i) {
    for (int j = 0; j < width; j += lanes) {
      const PixelLanes at = LocatePixels(input, faces, rect, i, j, planes);
      const std::size_t pixel = static_cast<std::size_t>(i * kTileSize + j);
      auto s = hn::Zero(d);
      for (int c = 0; c < channels; ++c) {
        const auto g = LoadFirst(d_out.data + c * d_out.plane + i * d_out.row + j,
                                 static_cast<std::size_t>(width - j));
        const auto h = hn::IfThenElseZero(at.seen, hn::Mul(g, at.inverse_q));
        const auto value =
            hn::Mul(EvaluatePlane(planes->numerator(c), at.slot, at.x, at.y), at.inverse_q);
        s = hn::MulAdd(h, value, s);
        hn::Store(h, d, planes->h(c) + pixel);
      }
      hn::Store(hn::IfThenElseZero(at.seen, s), d, planes->h(channels) + pixel);
    }
  }
}

// Sums f, f x, f y per slot over the pixels of the tile, in scan order.
void SumMoments(const TileFaces& faces, const TileRect& rect, TilePlanes* planes) {
  const int arrays = planes->channels() + 1;
  float* moments = planes->moments();
  std::memset(moments, 0, sizeof(float) * static_cast<std::size_t>(3 * arrays * faces.count));
  const float* h = planes->h(0);
  for (int i = 0; i < rect.y1 - rect.y0; ++i) {
    for (int j = 0; j < rect.x1 - rect.x0; ++j) {
      const int pixel = i * kTileSize + j;
      const int slot = faces.slot[pixel];
      if (slot < 0) continue;
      const float x = static_cast<float>(rect.x0 + j) + 0.5f - faces.origin_x[slot];
      const float y = static_cast<float>(rect.y0 + i) + 0.5f - faces.origin_y[slot];
      float* to = moments + 3 * arrays * slot;
      for (int c = 0; c < arrays; ++c) {
        const float f = h[kTilePixels * c + pixel];
        to[c] += f, to[arrays + c] += f * x, to[2 * arrays + c] += f * y;
      }
    }
  }
}

// S_k of one array for a vector of slots.
HWY_INLINE Lane WeightedSum(const Plane& weight, const Plane& moment) {
  return hn::MulAdd(weight.value, moment.value,
                    hn::MulAdd(weight.dx, moment.dx, hn::Mul(weight.dy, moment.dy)));
}

HWY_INLINE Plane GatherMoments(TilePlanes* planes, std::size_t s, int array) {
  const LaneTag d;
  const LaneIntTag di;
  const int arrays = planes->channels() + 1;
  const auto slot = hn::Iota(di, static_cast<std::int32_t>(s));
  const auto at = hn::Mul(slot, hn::Set(di, 3 * arrays));
  const float* base = planes->moments() + array;
  return {hn::GatherIndex(d, base, at), hn::GatherIndex(d, base + arrays, at),
          hn::GatherIndex(d, base + 2 * arrays, at)};
}

// From moments to the gradient of one vector of faces.
HWY_INLINE void FinishLanes(const InterpolateInput& input, std::size_t s, TilePlanes* planes,
                            std::size_t stride, float* d_faces) {
  const LaneTag d;
  const LaneIntTag di;
  const int channels = planes->channels();
  const bool perspective = input.mode == Interpolation::kPerspective;
  const Plane q = LoadPlane(planes->q() + s), moment_s = GatherMoments(planes, s, channels);
  for (int k = 0; k < 3; ++k) {
    const Plane weight = LoadPlane(planes->weight(k) + s);
    const auto m = hn::Load(d, planes->m(k) + s);
    const auto row = hn::Load(di, planes->row(k) + s);
    // Q is constant on screen-linear faces: its share vanishes.
    const auto sum_s = perspective ? WeightedSum(weight, moment_s) : hn::Zero(d);
    auto d_x = hn::Mul(q.dx, sum_s), d_y = hn::Mul(q.dy, sum_s), d_m = hn::Neg(sum_s);
    for (int c = 0; c < channels; ++c) {
      const auto sum = WeightedSum(weight, GatherMoments(planes, s, c));
      const Plane n = LoadPlane(planes->numerator(c) + s);
      const auto a = hn::GatherIndex(d, input.attributes.values.data() + c, row);
      d_x = hn::NegMulAdd(n.dx, sum, d_x);
      d_y = hn::NegMulAdd(n.dy, sum, d_y);
      d_m = hn::MulAdd(a, sum, d_m);
      const auto array = static_cast<std::size_t>(9 + k * channels + c);
      hn::StoreU(hn::Mul(m, sum), d, d_faces + array * stride + s);
    }
    const auto corner = static_cast<std::size_t>(k);
    hn::StoreU(d_x, d, d_faces + corner * stride + s);
    hn::StoreU(d_y, d, d_faces + (3 + corner) * stride + s);
    hn::StoreU(perspective ? d_m : hn::Zero(d), d, d_faces + (6 + corner) * stride + s);
  }
}

void InterpolateBackward(const InterpolateInput& input, const TileFaces& faces,
                         const TileRect& rect, const PlanarView<const float>& d_out,
                         TilePlanes* planes, std::size_t stride, float* d_faces) {
  const LaneTag d;
  PixelAdjoints(input, faces, rect, d_out, planes);
  SumMoments(faces, rect, planes);
  for (std::size_t s = 0; s < static_cast<std::size_t>(faces.count); s += hn::Lanes(d)) {
    FinishLanes(input, s, planes, stride, d_faces);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

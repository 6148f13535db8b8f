// SPDX-License-Identifier: Apache-2.0
// Vector body of interpolate.h. Lanes are slots (faces) where faces are set up, then outputs of a
// pixel.
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

#include "base/prefetch.h"
#include "raster/corner_planes-inl.h"
#include "raster/interpolate.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Equation 1 as planes: N of `count` channels (at most four) from `first` on.
HWY_INLINE void ChannelPlanes(const InterpolateInput& input, const CornerPlanes& corners, int first,
                              int count, Plane* out) {
  for (int c = 0; c < count; ++c) out[c] = ZeroPlane();
  for (int k = 0; k < 3; ++k) {
    Lane a[4];
    CornerAttributes(input, corners, k, first, a);
    for (int c = 0; c < count; ++c) {
      AddScaled(hn::Mul(corners.m[k], a[c]), corners.weight[k], &out[c]);  // (1): m_k a_kc b_k
    }
  }
}

// N of corner k's barycentric (equation 2), k = 1 or 2.
HWY_INLINE Plane BarycentricPlane(const CornerPlanes& corners, int k) {
  Plane n = ZeroPlane();
  AddScaled(corners.m[k], corners.weight[k], &n);
  return n;
}

// Position of an output: group 0 has three outputs and Q.
HWY_INLINE int FirstOutput(int group) { return group == 0 ? 0 : 4 * group - 1; }
HWY_INLINE int GroupOutputs(int group) { return group == 0 ? 3 : 4; }

// One vector of slots of a group.
HWY_INLINE void StoreQuads(const Plane (&p)[4], int group, std::size_t s, PlaneQuads* quads) {
  const LaneTag d;
  const auto store = [&](Lane a, Lane b, Lane c, Lane e, int part) HWY_ATTR {
    hn::StoreInterleaved4(a, b, c, e, d, quads->quads(group, part) + 4 * s);
  };
  store(p[0].value, p[1].value, p[2].value, p[3].value, 0);
  store(p[0].dx, p[1].dx, p[2].dx, p[3].dx, 1);
  store(p[0].dy, p[1].dy, p[2].dy, p[3].dy, 2);
}

HWY_INLINE void SetUpQuads(const InterpolateInput& input, const SeenFaces& seen, int outputs,
                           PlaneQuads* quads) {
  const LaneTag d;
  const auto lowest = hn::Set(d, -std::numeric_limits<float>::max());
  for (std::size_t s = 0; s < seen.stride(); s += hn::Lanes(d)) {
    const CornerPlanes corners = MakeCornerPlanes(
        input, hn::Load(LaneIntTag(), seen.face.data() + s), hn::Load(d, seen.origin_x.data() + s),
        hn::Load(d, seen.origin_y.data() + s));
    hn::StoreInterleaved4(lowest, lowest, lowest, corners.least_q, d, quads->least() + 4 * s);
    for (int g = 0; g < quads->groups(); ++g) {
      Plane planes[4];
      planes[3] = corners.q;
      const int first = FirstOutput(g), all = GroupOutputs(g), channels = input.attributes.channels;
      const int count = HWY_MIN(HWY_MAX(channels - first, 0), all);
      if (count > 0) ChannelPlanes(input, corners, first, count, planes);
      for (int i = count; i < all; ++i) {
        const int k = first + i - channels + 1;
        planes[i] = first + i < outputs ? BarycentricPlane(corners, k) : ZeroPlane();
      }
      StoreQuads(planes, g, s, quads);
    }
  }
}

// What pixels read about the visible faces, by slot. Held by value: behind a reference, compilers
// would assume that vector stores change it, and reload it.
struct SlotArrays {
  const std::int32_t* slot_of_face;
  const float *origin_x, *origin_y;
  const float *value, *dx, *dy, *least;  // quads of a group

  HWY_INLINE SlotArrays(InterpolateScratch* scratch, int group)
      : slot_of_face(scratch->seen.slot_of_face.data()),
        origin_x(scratch->seen.origin_x.data()),
        origin_y(scratch->seen.origin_y.data()),
        value(scratch->quads.quads(group, 0)),
        dx(scratch->quads.quads(group, 1)),
        dy(scratch->quads.quads(group, 2)),
        least(scratch->quads.least()) {}
};

// Evaluates the planes of a group at four pixels of a row; out[k] is output k of the four. `faces`:
// of the pixels; (px, py): the centre of the first.
template <bool kWithQ>
HWY_INLINE void EvaluateQuads(const SlotArrays& slots, const std::int32_t* faces, float px,
                              float py, Quad (&out)[4]) {
  const QuadTag d;
  for (int p = 0; p < kQuadPixels; ++p) {
    const auto slot = static_cast<std::size_t>(slots.slot_of_face[1 + faces[p]]), at = 4 * slot;
    const Quad x = hn::Set(d, px + static_cast<float>(p) - slots.origin_x[slot]);
    const Quad y = hn::Set(d, py - slots.origin_y[slot]);
    out[p] = hn::MulAdd(hn::Load(d, slots.dx + at), x,
                        hn::MulAdd(hn::Load(d, slots.dy + at), y, hn::Load(d, slots.value + at)));
    if (kWithQ) out[p] = hn::Max(out[p], hn::Load(d, slots.least + at));
  }
  Transpose(d, out);
}

// Input, scratch and output of one call.
struct InterpolateJob {
  const InterpolateInput& input;
  const FaceRows& rows;
  const InterpolateOutput& out;
  int outputs;
  InterpolateScratch* scratch;
};

// One row of the outputs of a group.
struct QuadRow {
  float* to[4];            // the row's pixels of each output
  std::ptrdiff_t step[4];  // to the next row
  int outputs;             // their number
  int count;               // pixels

  HWY_INLINE QuadRow(const InterpolateJob& job, int group, int i) {
    const int first = FirstOutput(group), channels = job.input.attributes.channels;
    outputs = HWY_MIN(GroupOutputs(group), job.outputs - first);
    count = job.out.columns;
    for (int k = 0; k < outputs; ++k) {
      const int o = first + k;
      const auto& view = o < channels ? job.out.attributes : job.out.barycentrics;
      to[k] = view.data + (o < channels ? o : o - channels) * view.plane +
              (i - job.rows.row_begin) * view.row;
      step[k] = view.row;
    }
  }
  // Prefetches the row `rows` below.
  HWY_INLINE void Prefetch(int rows) const {
    for (int k = 0; k < outputs; ++k) {
      PrefetchNumbers(to[k] + rows * step[k], static_cast<std::size_t>(count));
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

// One row of a group, with kOutputs outputs unless that is 0. Group 0 sets the row's inverse_q
// [kBinSize] for the groups after it.
template <bool kPerspective, int kOutputs>
HWY_INLINE void InterpolateRow(const InterpolateJob& job, const QuadRow& row, int group, int i,
                               float* inverse_q) {
  const QuadTag d;
  const std::int32_t* const faces = job.rows.row(i);
  const SlotArrays slots(job.scratch, group);
  const int outputs = kOutputs == 0 ? row.outputs : kOutputs;
  const float py = static_cast<float>(i) + 0.5f;
  float px = static_cast<float>(job.rows.x0) + 0.5f;
  for (int j = 0; j < row.count; j += kQuadPixels, px += kQuadPixels) {
    const auto seen = SeesFace(faces + j);
    if (hn::AllFalse(d, seen)) {
      for (int k = 0; k < outputs; ++k) row.Store(k, j, hn::Zero(d));
      continue;
    }
    Quad values[4];
    auto scale = hn::Set(d, 1.0f);
    if (kPerspective && group == 0) {
      EvaluateQuads<true>(slots, faces + j, px, py, values);
      hn::Store(hn::Div(scale, values[3]), d, inverse_q + j);
    } else {
      EvaluateQuads<false>(slots, faces + j, px, py, values);
    }
    if (kPerspective) scale = hn::Load(d, inverse_q + j);
    for (int k = 0; k < outputs; ++k) {
      const auto value = kPerspective ? hn::Mul(values[k], scale) : values[k];  // (1): N / Q
      row.Store(k, j, hn::IfThenElseZero(seen, value));
    }
  }
}

template <bool kPerspective>
HWY_INLINE void InterpolateRows(const InterpolateJob& job) {
  constexpr int kRowsAhead = 2;  // a row takes about as long as memory does
  constexpr int kColors = 3;     // outputs that most images have
  for (int i = job.rows.row_begin; i < job.rows.row_end; ++i) {
    HWY_ALIGN float inverse_q[kBinSize];
    for (int g = 0; g < job.scratch->quads.groups(); ++g) {
      const QuadRow row(job, g, i);
      if (i + kRowsAhead < job.rows.row_end) row.Prefetch(kRowsAhead);
      if (row.outputs == kColors) {
        InterpolateRow<kPerspective, kColors>(job, row, g, i, inverse_q);
      } else {
        InterpolateRow<kPerspective, 0>(job, row, g, i, inverse_q);
      }
    }
  }
}

// Rows are [kBinSize] wide.
void InterpolateFaces(const InterpolateInput& input, const FaceRows& rows,
                      const InterpolateOutput& out, InterpolateScratch* scratch) {
  const InterpolateJob job{input, rows, out, InterpolateOutputs(input), scratch};
  SetUpQuads(input, scratch->seen, job.outputs, &scratch->quads);
  if (input.mode == Interpolation::kPerspective) {
    InterpolateRows<true>(job);
  } else {
    InterpolateRows<false>(job);
  }
}

// Rows of background.
void ClearPixels(const InterpolateInput& input, const FaceRows& rows,
                 const InterpolateOutput& out) {
  const InterpolateJob job{input, rows, out, InterpolateOutputs(input), nullptr};
  const auto bytes = static_cast<std::size_t>(out.columns) * sizeof(float);
  constexpr int kClearedAhead = 8;  // writing zeros is much faster than memory
  for (int g = 0; g < 1 + job.outputs / 4; ++g) {
    for (int i = rows.row_begin; i < rows.row_end; ++i) {
      const QuadRow row(job, g, i);
      if (i + kClearedAhead < rows.row_end) row.Prefetch(kClearedAhead);
      for (int k = 0; k < row.outputs; ++k) std::memset(row.to[k], 0, bytes);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif

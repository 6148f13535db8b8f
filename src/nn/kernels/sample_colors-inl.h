// SPDX-License-Identifier: Apache-2.0
// Vector body of sample_colors.h: lanes are vertices, the numbers of a cell are broadcast.

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>

#include "nn/kernels/sample_colors_ref.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;
constexpr std::size_t kMostLanes = hn::MaxLanes(Tag());

// CellWeights for a vector of vertices. Far centres are clamped to kFarthest, where no bell reaches
// the picture, and have no gradient there.
struct LaneWeights {
  static constexpr float kFarthest = 1e6f;
  HWY_ALIGN float w[kColorCells * kMostLanes], offset[kColorCells * kMostLanes];

  HWY_INLINE void Set(Vec mean, Vec tau) {
    const Tag d;
    const Vec at = hn::Min(hn::Max(mean, hn::Set(d, -kFarthest)), hn::Set(d, kFarthest));
    for (std::size_t i = 0; i < kColorCells; ++i) {
      const Vec away = hn::Sub(hn::Set(d, CellCentre<float>(i)), at);
      const Vec exponent = hn::Mul(hn::Neg(tau), hn::Mul(away, away));
      const Vec bell = hn::Exp(d, hn::Max(exponent, hn::Set(d, -80.0f)));
      hn::Store(away, d, offset + i * hn::Lanes(d));
      hn::Store(hn::Add(bell, hn::Set(d, static_cast<float>(kFarWeight))), d, w + i * hn::Lanes(d));
    }
  }
  HWY_INLINE Vec At(std::size_t i) const { return hn::Load(Tag(), w + i * hn::Lanes(Tag())); }

  // Back-propagates `by_w`, the derivatives by w.
  HWY_INLINE void Backward(const float* by_w, Vec tau, Vec* by_mean, Vec* by_tau) const {
    const Tag d;
    *by_mean = hn::Zero(d);
    for (std::size_t i = 0; i < kColorCells; ++i) {
      const Vec away = hn::Load(d, offset + i * hn::Lanes(d));
      const Vec bell = hn::Sub(At(i), hn::Set(d, static_cast<float>(kFarWeight)));
      const Vec slope = hn::Mul(hn::Mul(hn::Load(d, by_w + i * hn::Lanes(d)), bell), away);
      *by_mean = hn::Add(*by_mean, slope);
      *by_tau = hn::NegMulAdd(slope, away, *by_tau);
    }
    *by_mean = hn::Mul(*by_mean, hn::Add(tau, tau));
  }
};

// SampledColor for a vector of vertices.
struct LaneColors {
  const ColorCells<float>& cells;
  Vec wide, tau, gain, sum[4];
  LaneWeights x, y;

  HWY_INLINE LaneColors(const ColorCells<float>& c, const float* flow) : cells(c) {
    const Tag d;
    Vec at_x, at_y, narrow;
    hn::LoadInterleaved4(d, flow, at_x, at_y, narrow, gain);
    const auto bounded = hn::Gt(narrow, hn::Set(d, static_cast<float>(kWidest)));
    const Vec exponent = hn::Min(hn::Neg(narrow), hn::Set(d, static_cast<float>(-kWidest)));
    wide = hn::IfThenElseZero(bounded, hn::Exp(d, hn::Max(exponent, hn::Set(d, -80.0f))));
    tau = hn::IfThenElseZero(
        bounded,
        hn::Div(hn::Set(d, 0.5f), hn::Add(wide, hn::Set(d, static_cast<float>(kLeastVariance)))));
    gain = hn::Add(gain, hn::Set(d, 1.0f));
    x.Set(at_x, tau);
    y.Set(at_y, tau);
    Sum();
  }

  HWY_INLINE void Sum() {
    const Tag d;
    for (Vec& s : sum) s = hn::Zero(d);
    for (std::size_t j = 0; j < kColorCells; ++j) {
      Vec r0 = hn::Zero(d), r1 = r0, r2 = r0, r3 = r0;
      for (std::size_t i = 0; i < kColorCells; ++i) {
        const float* cell = &cells[j][4 * i];
        const Vec w = x.At(i);
        r0 = hn::MulAdd(w, hn::Set(d, cell[0]), r0);
        r1 = hn::MulAdd(w, hn::Set(d, cell[1]), r1);
        r2 = hn::MulAdd(w, hn::Set(d, cell[2]), r2);
        r3 = hn::MulAdd(w, hn::Set(d, cell[3]), r3);
      }
      const Vec w = y.At(j);
      sum[0] = hn::MulAdd(w, r0, sum[0]);
      sum[1] = hn::MulAdd(w, r1, sum[1]);
      sum[2] = hn::MulAdd(w, r2, sum[2]);
      sum[3] = hn::MulAdd(w, r3, sum[3]);
    }
    sum[3] = hn::Add(sum[3], hn::Set(d, static_cast<float>(kNothing)));
  }

  HWY_INLINE void Forward(float* colors) const {
    const Vec scale = hn::Div(gain, sum[3]);
    hn::StoreInterleaved3(hn::Mul(scale, sum[0]), hn::Mul(scale, sum[1]), hn::Mul(scale, sum[2]),
                          Tag(), colors);
  }

  // Derivatives by `sum`, and by the gain.
  HWY_INLINE Vec BySums(const float* by_color, Vec* by_sum) const {
    const Tag d;
    hn::LoadInterleaved3(d, by_color, by_sum[0], by_sum[1], by_sum[2]);
    const Vec scale = hn::Div(gain, sum[3]);
    Vec by_gain = hn::Zero(d);
    by_sum[3] = hn::Zero(d);
    for (int c = 0; c < 3; ++c) {
      const Vec mean = hn::Div(sum[c], sum[3]);
      by_gain = hn::MulAdd(by_sum[c], mean, by_gain);
      by_sum[c] = hn::Mul(by_sum[c], scale);
      by_sum[3] = hn::NegMulAdd(by_sum[c], mean, by_sum[3]);
    }
    return by_gain;
  }

  HWY_INLINE void Backward(const float* by_color, float* by_flow) const {
    const Tag d;
    const std::size_t lanes = hn::Lanes(d);
    Vec by_sum[4];
    const Vec by_gain = BySums(by_color, by_sum);
    HWY_ALIGN float by_x[kColorCells * kMostLanes] = {}, by_y[kColorCells * kMostLanes];
    for (std::size_t j = 0; j < kColorCells; ++j) {
      Vec column = hn::Zero(d);
      const Vec w = y.At(j);
      for (std::size_t i = 0; i < kColorCells; ++i) {
        const float* cell = &cells[j][4 * i];
        Vec through = hn::Mul(by_sum[0], hn::Set(d, cell[0]));
        for (int c = 1; c < 4; ++c) through = hn::MulAdd(by_sum[c], hn::Set(d, cell[c]), through);
        column = hn::MulAdd(x.At(i), through, column);
        float* const at = by_x + i * lanes;
        hn::Store(hn::MulAdd(w, through, hn::Load(d, at)), d, at);
      }
      hn::Store(column, d, by_y + j * lanes);
    }
    Vec by_tau = hn::Zero(d), by_mean_x, by_mean_y;
    x.Backward(by_x, tau, &by_mean_x, &by_tau);
    y.Backward(by_y, tau, &by_mean_y, &by_tau);
    const Vec by_narrow = hn::Mul(hn::Mul(by_tau, wide), hn::Mul(hn::Add(tau, tau), tau));
    hn::StoreInterleaved4(by_mean_x, by_mean_y, by_narrow, by_gain, d, by_flow);
  }
};

// Calls run(first vertex, count) for each vector of vertices; the last may hold fewer.
template <class Run>
HWY_INLINE void ForVectors(std::size_t vertices, const Run& run) {
  const std::size_t lanes = hn::Lanes(Tag());
  for (std::size_t v = 0; v < vertices; v += lanes) run(v, std::min(lanes, vertices - v));
}

// `count` rows of W numbers, the others 0.
template <std::size_t W>
struct Rows {
  HWY_ALIGN float at[W * kMostLanes];
  HWY_INLINE Rows() : at{} {}
  HWY_INLINE Rows(const float* from, std::size_t count) : at{} { std::copy_n(from, W * count, at); }
};

void SampleForward(const ColorCells<float>& cells, const ColorSpans<float>& s) {
  ForVectors(s.vertices, [&](std::size_t v, std::size_t count) HWY_ATTR {
    Rows<3> colors;
    LaneColors(cells, Rows<4>(s.flow + 4 * v, count).at).Forward(colors.at);
    std::copy_n(colors.at, 3 * count, s.colors + 3 * v);
  });
}

void SampleBackward(const ColorCells<float>& cells, const ColorSpans<float>& s) {
  ForVectors(s.vertices, [&](std::size_t v, std::size_t count) HWY_ATTR {
    Rows<4> by_flow;
    LaneColors(cells, Rows<4>(s.flow + 4 * v, count).at)
        .Backward(Rows<3>(s.by_color + 3 * v, count).at, by_flow.at);
    std::copy_n(by_flow.at, 4 * count, s.by_flow + 4 * v);
  });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

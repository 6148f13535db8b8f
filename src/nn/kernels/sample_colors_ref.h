// SPDX-License-Identifier: Apache-2.0
// Scalar reference of sample_colors.h: one vertex, forward and backward.
#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

namespace tilegrad::nn {

inline constexpr std::size_t kColorCells = 16;  // along each side of the picture
// Weight of far cells: every cell has some, so the mean exists wherever the centre is.
inline constexpr double kFarWeight = 1e-4;

// Least variance of the bell: a cell's side, squared. Below kWidest all cells have equal weight.
inline constexpr double kLeastVariance = 4.0 / (kColorCells * kColorCells), kWidest = -20;
inline constexpr double kNothing = 1e-12;  // added to the visible coverage: nothing is black

// Premultiplied RGBA of the cells, row by row.
template <class T>
using ColorCells = std::array<std::array<T, 4 * kColorCells>, kColorCells>;

template <class T>
T CellCentre(std::size_t i) {
  return T((2.0 * static_cast<double>(i) + 1) / kColorCells - 1);
}

// One picture's vertices. Null for what a pass does not need.
template <class T>
struct ColorSpans {
  std::size_t vertices;
  const T* flow;      // [vertices][4]
  T* colors;          // [vertices][3]
  const T* by_color;  // [vertices][3]
  T* by_flow;         // [vertices][4]
};

// The weights of one axis: of cell i, w[i] = exp(-tau (c_i - mean)^2) + kFarWeight, where c_i is
// its centre in [-1, 1].
template <class T>
struct CellWeights {
  std::array<T, kColorCells> w, bell, offset;

  CellWeights(T mean, T tau) {
    for (std::size_t i = 0; i < kColorCells; ++i) {
      offset[i] = CellCentre<T>(i) - mean;
      bell[i] = std::exp(-tau * offset[i] * offset[i]);
      w[i] = bell[i] + T(kFarWeight);
    }
  }
  // Adds to the derivatives by mean and tau, given d, the derivatives by w.
  void Backward(const std::array<T, kColorCells>& d, T tau, T* d_mean, T* d_tau) const {
    for (std::size_t i = 0; i < kColorCells; ++i) {
      *d_mean += d[i] * bell[i] * 2 * tau * offset[i];
      *d_tau -= d[i] * bell[i] * offset[i] * offset[i];
    }
  }
};

// flow: x, y, narrowness, gain.
template <class T>
class SampledColor {
 public:
  SampledColor(const ColorCells<T>& cells, const T* flow)
      : cells_(cells),
        wide_(std::real(flow[2]) > kWidest ? std::exp(-flow[2]) : T(0)),
        tau_(std::real(flow[2]) > kWidest ? T(0.5) / (T(kLeastVariance) + wide_) : T(0)),
        gain_(T(1) + flow[3]),
        x_(flow[0], tau_),
        y_(flow[1], tau_) {
    for (std::size_t j = 0; j < kColorCells; ++j) {
      rows_[j] = {};
      for (std::size_t i = 0; i < kColorCells; ++i) {
        for (std::size_t c = 0; c < 4; ++c) rows_[j][c] += x_.w[i] * cells[j][4 * i + c];
      }
      for (std::size_t c = 0; c < 4; ++c) sum_[c] += y_.w[j] * rows_[j][c];
    }
    sum_[3] += T(kNothing);
  }

  void Forward(T* color) const {
    for (std::size_t c = 0; c < 3; ++c) color[c] = gain_ * sum_[c] / sum_[3];
  }

  void Backward(const T* d_color, T* d_flow) const {
    std::array<T, 4> d_sum{};
    T d_gain = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const T mean = sum_[c] / sum_[3];
      d_gain += d_color[c] * mean;
      d_sum[c] = d_color[c] * gain_ / sum_[3];
      d_sum[3] -= d_sum[c] * mean;
    }
    std::array<T, kColorCells> d_x{}, d_y{};
    for (std::size_t j = 0; j < kColorCells; ++j) {
      for (std::size_t c = 0; c < 4; ++c) d_y[j] += d_sum[c] * rows_[j][c];
      for (std::size_t i = 0; i < kColorCells; ++i) {
        T through = 0;
        for (std::size_t c = 0; c < 4; ++c) through += d_sum[c] * cells_[j][4 * i + c];
        d_x[i] += y_.w[j] * through;
      }
    }
    T d_tau = 0;
    d_flow[0] = d_flow[1] = 0;
    x_.Backward(d_x, tau_, &d_flow[0], &d_tau);
    y_.Backward(d_y, tau_, &d_flow[1], &d_tau);
    d_flow[2] = d_tau * 2 * tau_ * tau_ * wide_;
    d_flow[3] = d_gain;
  }

 private:
  const ColorCells<T>& cells_;
  T wide_, tau_, gain_;
  CellWeights<T> x_, y_;
  std::array<std::array<T, 4>, kColorCells> rows_;
  std::array<T, 4> sum_{};
};

template <class T>
void SampleForwardRef(const ColorCells<T>& cells, const ColorSpans<T>& s) {
  for (std::size_t v = 0; v < s.vertices; ++v)
    SampledColor<T>(cells, s.flow + 4 * v).Forward(s.colors + 3 * v);
}

template <class T>
void SampleBackwardRef(const ColorCells<T>& cells, const ColorSpans<T>& s) {
  for (std::size_t v = 0; v < s.vertices; ++v)
    SampledColor<T>(cells, s.flow + 4 * v).Backward(s.by_color + 3 * v, s.by_flow + 4 * v);
}

}  // namespace tilegrad::nn

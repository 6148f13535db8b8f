// SPDX-License-Identifier: Apache-2.0
// The transforms of F(2, r) along one axis, their adjoints, and their application to both axes.
// With the slots 0, 1, infinity (and -1 for r = 3):
//
//   y = A^T ((G g) * (B^T d)),  y0 = m0 + m1 + m3,  y1 = m1 + m2 - m3
//
//   r = 2:  B^T d = d0 - d1, d1, d2 - d1              G g = g0, g0 + g1, g1
//   r = 3:  B^T d = d0 - d2, d1 + d2, d3 - d1, d2 - d1
//           G g = g0, (g0 + g1 + g2) / 2, g2, (g0 - g1 + g2) / 2

#if defined(TILEGRAD_NN_CONV2D_WINOGRAD_TRANSFORM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_CONV2D_WINOGRAD_TRANSFORM_INL_H_
#undef TILEGRAD_NN_CONV2D_WINOGRAD_TRANSFORM_INL_H_
#else
#define TILEGRAD_NN_CONV2D_WINOGRAD_TRANSFORM_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

using Line = Vec[4];     // values along one axis
using Square = Line[4];  // along both

template <std::size_t R>
struct DataTransform {  // B^T
  static constexpr std::size_t kIn = R + 1, kOut = R + 1;
  static HWY_INLINE void Apply(const Line& d, Line& out) {
    if constexpr (R == 2) {
      out[0] = hn::Sub(d[0], d[1]);
      out[1] = d[1];
      out[2] = hn::Sub(d[2], d[1]);
    } else {
      out[0] = hn::Sub(d[0], d[2]);
      out[1] = hn::Add(d[1], d[2]);
      out[2] = hn::Sub(d[3], d[1]);
      out[3] = hn::Sub(d[2], d[1]);
    }
  }
};

template <std::size_t R>
struct DataAdjoint {  // B
  static constexpr std::size_t kIn = R + 1, kOut = R + 1;
  static HWY_INLINE void Apply(const Line& e, Line& out) {
    out[0] = e[0];
    if constexpr (R == 2) {
      out[1] = hn::Sub(e[1], hn::Add(e[0], e[2]));
      out[2] = e[2];
    } else {
      out[1] = hn::Sub(e[1], hn::Add(e[2], e[3]));
      out[2] = hn::Add(hn::Sub(e[1], e[0]), e[3]);
      out[3] = e[2];
    }
  }
};

template <std::size_t R>
struct WeightTransform {  // G
  static constexpr std::size_t kIn = R, kOut = R + 1;
  static HWY_INLINE void Apply(const Line& g, Line& out) {
    out[0] = g[0];
    out[2] = g[R - 1];
    if constexpr (R == 2) {
      out[1] = hn::Add(g[0], g[1]);
    } else {
      const Vec half = hn::Set(Tag(), 0.5f), ends = hn::Add(g[0], g[2]);
      out[1] = hn::Mul(half, hn::Add(ends, g[1]));
      out[3] = hn::Mul(half, hn::Sub(ends, g[1]));
    }
  }
};

template <std::size_t R>
struct WeightAdjoint {  // G^T
  static constexpr std::size_t kIn = R + 1, kOut = R;
  static HWY_INLINE void Apply(const Line& u, Line& out) {
    if constexpr (R == 2) {
      out[0] = hn::Add(u[0], u[1]);
      out[1] = hn::Add(u[1], u[2]);
    } else {
      const Vec half = hn::Set(Tag(), 0.5f), even = hn::Mul(half, hn::Add(u[1], u[3]));
      out[0] = hn::Add(u[0], even);
      out[1] = hn::Mul(half, hn::Sub(u[1], u[3]));
      out[2] = hn::Add(even, u[2]);
    }
  }
};

template <std::size_t kSlots>
struct OutputTransform {  // A^T
  static constexpr std::size_t kIn = kSlots, kOut = 2;
  static HWY_INLINE void Apply(const Line& m, Line& out) {
    out[0] = hn::Add(m[0], m[1]);
    out[1] = hn::Add(m[1], m[2]);
    if constexpr (kSlots == 4) {
      out[0] = hn::Add(out[0], m[3]);
      out[1] = hn::Sub(out[1], m[3]);
    }
  }
};

template <std::size_t kSlots>
struct OutputAdjoint {  // A
  static constexpr std::size_t kIn = 2, kOut = kSlots;
  static HWY_INLINE void Apply(const Line& y, Line& out) {
    out[0] = y[0];
    out[1] = hn::Add(y[0], y[1]);
    out[2] = y[1];
    if constexpr (kSlots == 4) out[3] = hn::Sub(y[0], y[1]);
  }
};

// out = Down in Across^T.
template <class Down, class Across>
HWY_INLINE void Transform(const Square& in, Square& out) {
  Square half;
  for (std::size_t j = 0; j < Across::kIn; ++j) {
    Line column, turned;
    for (std::size_t i = 0; i < Down::kIn; ++i) column[i] = in[i][j];
    Down::Apply(column, turned);
    for (std::size_t i = 0; i < Down::kOut; ++i) half[i][j] = turned[i];
  }
  for (std::size_t i = 0; i < Down::kOut; ++i) Across::Apply(half[i], out[i]);
}

// Runs Body<Ra, Rb>::Run(args...) for the taps of a phase's two axes.
template <template <std::size_t, std::size_t> class Body, class... Args>
HWY_INLINE void ForTaps(std::size_t down, std::size_t across, const Args&... args) {
  if (down == 2) {
    across == 2 ? Body<2, 2>::Run(args...) : Body<2, 3>::Run(args...);
  } else {
    across == 2 ? Body<3, 2>::Run(args...) : Body<3, 3>::Run(args...);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

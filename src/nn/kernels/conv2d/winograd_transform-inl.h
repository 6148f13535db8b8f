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

#include <algorithm>
#include <cstddef>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Converts between an image row and the places of its tiles, a vector of tiles at a time, for
// winograd_tiles-inl.h.

// Vectors for rows of `tiles`: short ones for short rows.
template <class Body>
HWY_INLINE void ForRowLanes(std::size_t tiles, const Body& body) {
  if (tiles <= 4) return body(hn::CappedTag<float, 4>());
  body(Tag());
}

// places[j][t] = padded[t step + j] for whole vectors of tiles: up to kLanes - 1 excess tiles.
template <std::size_t kSpan, std::size_t kStep>
HWY_INLINE void DealRow(const float* padded, std::size_t tiles, std::size_t pitch, float* places) {
  ForRowLanes(tiles, [&](auto d) HWY_ATTR {
    using V = hn::Vec<decltype(d)>;
    for (std::size_t t = 0; t < tiles; t += hn::Lanes(d)) {
      for (std::size_t first = 0; first < kSpan; first += kStep) {
        V v[4];
        if constexpr (kStep == 2) {
          hn::LoadInterleaved2(d, padded + t * kStep + first, v[0], v[1]);
        } else {
          hn::LoadInterleaved4(d, padded + t * kStep + first, v[0], v[1], v[2], v[3]);
        }
        for (std::size_t j = 0; j < std::min(kStep, kSpan - first); ++j) {
          hn::StoreU(v[j], d, places + (first + j) * pitch + t);
        }
      }
    }
  });
}

struct RowOfTiles {
  std::size_t tiles, pitch;
  std::size_t overlap;  // pixels shared by adjacent tiles
};

// The inverse: places summed where tiles overlap, as a padded image row.
template <std::size_t kStep>
HWY_INLINE void SumRow(const float* places, const RowOfTiles& row, float* padded) {
  const std::size_t pitch = row.pitch;
  ForRowLanes(row.tiles, [&](auto d) HWY_ATTR {
    using V = hn::Vec<decltype(d)>;
    for (std::size_t t = 0; t < row.tiles; t += hn::Lanes(d)) {
      V v[4];
      for (std::size_t j = 0; j < kStep; ++j) v[j] = hn::LoadU(d, places + j * pitch + t);
      for (std::size_t j = 0; j < row.overlap; ++j) {
        // The contribution of the tile to the left; the first has none.
        const V left = hn::LoadU(d, places + (kStep + j) * pitch + t - 1);
        const V sum = hn::Add(v[j], left);
        v[j] = t > 0 ? sum : hn::IfThenElse(hn::FirstN(d, 1), v[j], sum);
      }
      if constexpr (kStep == 2) {
        hn::StoreInterleaved2(v[0], v[1], d, padded + t * kStep);
      } else {
        hn::StoreInterleaved4(v[0], v[1], v[2], v[3], d, padded + t * kStep);
      }
    }
  });
  for (std::size_t j = 0; j < kStep; ++j) {
    padded[row.tiles * kStep + j] =
        0.0f + (j < row.overlap ? places[(kStep + j) * pitch + row.tiles - 1] : 0.0f);
  }
}

// even[t] = pairs[2 t], odd[t] = pairs[2 t + 1]
inline void SplitPairs(const float* pairs, std::size_t count, float* even, float* odd) {
  ForRowLanes(count, [&](auto d) HWY_ATTR {
    using V = hn::Vec<decltype(d)>;
    std::size_t t = 0;
    for (; t + hn::Lanes(d) <= count; t += hn::Lanes(d)) {
      V v0, v1;
      hn::LoadInterleaved2(d, pairs + 2 * t, v0, v1);
      hn::StoreU(v0, d, even + t);
      hn::StoreU(v1, d, odd + t);
    }
    for (; t < count; ++t) {
      even[t] = pairs[2 * t];
      odd[t] = pairs[2 * t + 1];
    }
  });
}

inline void JoinPairs(const float* even, const float* odd, std::size_t count, float* pairs) {
  ForRowLanes(count, [&](auto d) HWY_ATTR {
    std::size_t t = 0;
    for (; t + hn::Lanes(d) <= count; t += hn::Lanes(d)) {
      hn::StoreInterleaved2(hn::LoadU(d, even + t), hn::LoadU(d, odd + t), d, pairs + 2 * t);
    }
    for (; t < count; ++t) {
      pairs[2 * t] = even[t];
      pairs[2 * t + 1] = odd[t];
    }
  });
}

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

// SPDX-License-Identifier: Apache-2.0
// Between one image row and the places of its tiles, a vector of tiles at a time, for
// winograd_tiles-inl.h.

#if defined(TILEGRAD_NN_CONV2D_WINOGRAD_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_CONV2D_WINOGRAD_ROWS_INL_H_
#undef TILEGRAD_NN_CONV2D_WINOGRAD_ROWS_INL_H_
#else
#define TILEGRAD_NN_CONV2D_WINOGRAD_ROWS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Vectors for rows of `tiles`: short ones for short rows.
template <class Body>
HWY_INLINE void ForRowLanes(std::size_t tiles, const Body& body) {
  if (tiles <= 4) return body(hn::CappedTag<float, 4>());
  body(Tag());
}

// places[j][t] = padded[t step + j] for whole vectors of tiles: up to kLanes - 1 more than there
// are.
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
  std::size_t overlap;  // pixels that a tile and the next one both see
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
        // What the tile to the left adds; the first one has none.
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

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

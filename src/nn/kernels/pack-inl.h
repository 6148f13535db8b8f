// SPDX-License-Identifier: Apache-2.0
// Packs a strip of a matrix in the order in which the micro-kernel reads it.

#if defined(TILEGRAD_NN_KERNELS_PACK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_KERNELS_PACK_INL_H_
#undef TILEGRAD_NN_KERNELS_PACK_INL_H_
#else
#define TILEGRAD_NN_KERNELS_PACK_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>

#include "nn/kernels/micro_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Four numbers of one row, or of rows i and i + 4, side by side.
template <class D>
HWY_INLINE hn::Vec<D> LoadFours(D d, const float* in, std::size_t in_stride) {
  if constexpr (hn::MaxLanes(d) == 4) {
    return hn::LoadU(d, in);
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, hn::LoadU(half, in + 4 * in_stride), hn::LoadU(half, in));
  }
}

// out[k * out_stride + i] = in[i * in_stride + k] for k < 4 and as many i as d has lanes, 4 or 8.
template <class D>
HWY_INLINE void TransposeFours(D d, const float* in, std::size_t in_stride, float* out,
                               std::size_t out_stride) {
  const hn::RepartitionToWide<D> pairs;
  const auto r0 = LoadFours(d, in, in_stride), r1 = LoadFours(d, in + in_stride, in_stride);
  const auto r2 = LoadFours(d, in + 2 * in_stride, in_stride);
  const auto r3 = LoadFours(d, in + 3 * in_stride, in_stride);
  const auto low01 = hn::BitCast(pairs, hn::InterleaveLower(d, r0, r1));  // r0[0] r1[0] r0[1] r1[1]
  const auto low23 = hn::BitCast(pairs, hn::InterleaveLower(d, r2, r3));
  const auto high01 = hn::BitCast(pairs, hn::InterleaveUpper(d, r0, r1));
  const auto high23 = hn::BitCast(pairs, hn::InterleaveUpper(d, r2, r3));
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, low01, low23)), d, out);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, low01, low23)), d, out + out_stride);
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, high01, high23)), d, out + 2 * out_stride);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, high01, high23)), d, out + 3 * out_stride);
}

// The same for i < rows and k < steps, `d` lanes at a time; needs rows >= Lanes(d) and whole fours
// of steps.
template <class D>
HWY_INLINE void TransposeStripBy(D d, const float* in, std::size_t in_stride, std::size_t rows,
                                 std::size_t steps, float* out, std::size_t out_stride) {
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i < rows; i += lanes) {
    const std::size_t row = std::min(i, rows - lanes);  // may overlap the block before it
    for (std::size_t k = 0; k < steps; k += 4) {
      TransposeFours(d, in + row * in_stride + k, in_stride, out + k * out_stride + row,
                     out_stride);
    }
  }
}

// out[k * out_stride + i] = in[i * in_stride + k] for i < rows, k < steps. Writes nothing else.
inline void TransposeStrip(const float* in, std::size_t in_stride, std::size_t rows,
                           std::size_t steps, float* out, std::size_t out_stride) {
  const hn::CappedTag<float, 8> wide;
  const std::size_t whole = rows < 4 ? 0 : steps / 4 * 4;
  if (rows >= hn::Lanes(wide)) {
    TransposeStripBy(wide, in, in_stride, rows, whole, out, out_stride);
  } else if (rows >= 4) {
    TransposeStripBy(hn::FixedTag<float, 4>(), in, in_stride, rows, whole, out, out_stride);
  }
  for (std::size_t k = whole; k < steps; ++k) {
    for (std::size_t i = 0; i < rows; ++i) out[k * out_stride + i] = in[i * in_stride + k];
  }
}

// out[k * out_stride + i] = in[k * in_stride + i] for i < rows, k < steps, `d` lanes at a time;
// needs rows >= Lanes(d).
template <class D>
HWY_INLINE void CopyStripBy(D d, const float* in, std::size_t in_stride, std::size_t rows,
                            std::size_t steps, float* out, std::size_t out_stride) {
  const std::size_t lanes = hn::Lanes(d), last = rows - lanes;
  for (std::size_t k = 0; k < steps; ++k, in += in_stride, out += out_stride) {
    for (std::size_t i = 0; i < last; i += lanes) hn::StoreU(hn::LoadU(d, in + i), d, out + i);
    hn::StoreU(hn::LoadU(d, in + last), d, out + last);  // may overlap the one before
  }
}

inline void CopyStrip(const float* in, std::size_t in_stride, std::size_t rows, std::size_t steps,
                      float* out, std::size_t out_stride) {
  if (rows >= kLanes) {
    CopyStripBy(Tag(), in, in_stride, rows, steps, out, out_stride);
  } else if (rows >= 4) {
    CopyStripBy(hn::FixedTag<float, 4>(), in, in_stride, rows, steps, out, out_stride);
  } else {
    CopyStripBy(hn::FixedTag<float, 1>(), in, in_stride, rows, steps, out, out_stride);
  }
}

// A matrix op(M) as the packers see it: `transposed` says that rows, not steps, are contiguous.
struct PackSource {
  const float* data;
  std::size_t ld;
  bool rows_contiguous;
};

// out[k * out_stride + i] = element (row + i, step + k) of the source.
inline void PackStrip(const PackSource& s, std::size_t row, std::size_t rows, std::size_t step,
                      std::size_t steps, float* out, std::size_t out_stride) {
  if (s.rows_contiguous) {
    CopyStrip(s.data + step * s.ld + row, s.ld, rows, steps, out, out_stride);
  } else {
    TransposeStrip(s.data + row * s.ld + step, s.ld, rows, steps, out, out_stride);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard

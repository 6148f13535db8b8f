// SPDX-License-Identifier: Apache-2.0
// Moves of elements: strided copies, gather and scatter. Nothing is computed but the sums of
// scatter, so there is no vector body: rows go through memcpy.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/parallel.h"

namespace tilegrad::nn {

// to[sum i strides_to] = from[sum i strides_from] for every index of a box. Axes that are not used
// have extent 1.
struct StridedBox {
  static constexpr int kRank = 5;
  using Axes = std::array<std::size_t, kRank>;
  Axes extents = {1, 1, 1, 1, 1};
  Axes strides_from{}, strides_to{};
};
template <class T>
void CopyStrided(const StridedBox& box, const T* from, T* to, const Workers& workers);

// Rows picked along the middle axis of [outer, extent, inner].
struct IndexedRows {
  std::size_t outer = 1, extent = 1, inner = 1;
  const std::int32_t* indices = nullptr;  // [count], each in [0, extent)
  std::size_t count = 0;
};
// y[o, i, :] = x[o, indices[i], :]; y is [outer, count, inner].
template <class T>
void GatherRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers);
// y = 0, then y[o, indices[i], :] += x[o, i, :] in the order of i; y is [outer, extent, inner].
template <class T>
void ScatterRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers);

// Elements picked along the last axis of [outer, extent], other ones for each row.
struct PickedElements {
  std::size_t outer = 1, extent = 1;
  const std::int32_t* indices = nullptr;  // [outer, count], each in [0, extent)
  std::size_t count = 0;
};
// y[o, i] = x[o, indices[o, i]]; y is [outer, count].
template <class T>
void TakeElements(const PickedElements& picked, const T* x, T* y, const Workers& workers);
// y = 0, then y[o, indices[o, i]] += x[o, i] in the order of i; y is [outer, extent].
template <class T>
void PlaceElements(const PickedElements& picked, const T* x, T* y, const Workers& workers);

}  // namespace tilegrad::nn

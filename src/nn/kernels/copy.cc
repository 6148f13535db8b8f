// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/copy.h"

#include <algorithm>

namespace tilegrad::nn {
namespace {

constexpr std::size_t kCopyGrain = 16384;  // elements to a task

std::size_t RowsPerTask(std::size_t length) {
  return std::max<std::size_t>(1, kCopyGrain / std::max<std::size_t>(1, length));
}

template <class T>
void CopyRow(const StridedBox& box, const T* from, T* to) {
  const std::size_t n = box.extents.back();
  const std::size_t step_from = box.strides_from.back(), step_to = box.strides_to.back();
  if (step_from == 1 && step_to == 1) {
    std::copy_n(from, n, to);
    return;
  }
  for (std::size_t i = 0; i < n; ++i) to[i * step_to] = from[i * step_from];
}

}  // namespace

template <class T>
void CopyStrided(const StridedBox& box, const T* from, T* to, const Workers& workers) {
  std::size_t rows = 1;
  for (std::size_t i = 0; i + 1 < box.extents.size(); ++i) rows *= box.extents[i];
  workers.ForRanges(rows, RowsPerTask(box.extents.back()),
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t row = begin; row < end; ++row) {
                        std::size_t rest = row, offset_from = 0, offset_to = 0;
                        for (std::size_t i = box.extents.size() - 1; i-- > 0;) {
                          const std::size_t index = rest % box.extents[i];
                          rest /= box.extents[i];
                          offset_from += index * box.strides_from[i];
                          offset_to += index * box.strides_to[i];
                        }
                        CopyRow(box, from + offset_from, to + offset_to);
                      }
                    });
}

template <class T>
void GatherRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers) {
  workers.ForRanges(rows.outer * rows.count, RowsPerTask(rows.inner),
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t row = begin; row < end; ++row) {
                        const std::size_t o = row / rows.count;
                        const auto index = static_cast<std::size_t>(rows.indices[row % rows.count]);
                        std::copy_n(x + (o * rows.extent + index) * rows.inner, rows.inner,
                                    y + row * rows.inner);
                      }
                    });
}

template <class T>
void ScatterRows(const IndexedRows& rows, const T* x, T* y, const Workers& workers) {
  workers.For(rows.outer, [&](std::size_t o, std::size_t) {
    T* to = y + o * rows.extent * rows.inner;
    std::fill_n(to, rows.extent * rows.inner, T(0));
    for (std::size_t i = 0; i < rows.count; ++i) {
      const T* from = x + (o * rows.count + i) * rows.inner;
      T* sum = to + static_cast<std::size_t>(rows.indices[i]) * rows.inner;
      for (std::size_t k = 0; k < rows.inner; ++k) sum[k] += from[k];
    }
  });
}

template <class T>
void TakeElements(const PickedElements& picked, const T* x, T* y, const Workers& workers) {
  workers.ForRanges(picked.outer, RowsPerTask(picked.count),
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t o = begin; o < end; ++o) {
                        const T* row = x + o * picked.extent;
                        for (std::size_t i = o * picked.count; i < (o + 1) * picked.count; ++i) {
                          y[i] = row[picked.indices[i]];
                        }
                      }
                    });
}

template <class T>
void PlaceElements(const PickedElements& picked, const T* x, T* y, const Workers& workers) {
  workers.ForRanges(picked.outer, RowsPerTask(picked.extent),
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t o = begin; o < end; ++o) {
                        T* row = y + o * picked.extent;
                        std::fill_n(row, picked.extent, T(0));
                        for (std::size_t i = o * picked.count; i < (o + 1) * picked.count; ++i) {
                          row[picked.indices[i]] += x[i];
                        }
                      }
                    });
}

#define TILEGRAD_INSTANTIATE(T)                                                    \
  template void CopyStrided(const StridedBox&, const T*, T*, const Workers&);      \
  template void GatherRows(const IndexedRows&, const T*, T*, const Workers&);      \
  template void ScatterRows(const IndexedRows&, const T*, T*, const Workers&);     \
  template void TakeElements(const PickedElements&, const T*, T*, const Workers&); \
  template void PlaceElements(const PickedElements&, const T*, T*, const Workers&)
TILEGRAD_INSTANTIATE(float);
TILEGRAD_INSTANTIATE(double);
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::nn

// SPDX-License-Identifier: Apache-2.0
// Work on one image that several workers may share.
#pragma once

#include <algorithm>
#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::raster {

// Calls task(begin, end) for ranges of at most `size` indices that make up [0, n); on the calling
// thread, in order, where `workers` is null or there is one range only.
template <class Task>
void ForChunks(const Workers* workers, std::size_t n, std::size_t size, const Task& task) {
  if (workers == nullptr || n <= size) {
    for (std::size_t i = 0; i < n; i += size) task(i, std::min(n, i + size));
    return;
  }
  workers->ForRanges(n, size,
                     [&](std::size_t begin, std::size_t end, std::size_t) { task(begin, end); });
}

}  // namespace tilegrad::raster

// SPDX-License-Identifier: Apache-2.0
// Where the largest element of each window of an image lies. Nothing is computed, and a window's
// few elements lie in few cache lines, so there is no vector body.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/parallel.h"

namespace tilegrad::nn {

struct PoolShape {
  std::size_t planes = 1, height = 1, width = 1;  // x: [planes, height, width]
  std::size_t out_height = 1, out_width = 1;      // first: [planes, out_height, out_width]
  std::size_t kernel = 1, stride = 1, padding = 0;
};

// first[p, i, j] = the index in plane p of the first element that attains the maximum over rows
// i stride - padding + [0, kernel) and columns alike, as far as they are in the image; some are,
// for every window. NaN counts as larger than everything.
void MaxPoolIndices(const PoolShape& shape, const float* x, std::int32_t* first,
                    const Workers& workers);
void MaxPoolIndices(const PoolShape& shape, const double* x, std::int32_t* first,
                    const Workers& workers);

}  // namespace tilegrad::nn

// SPDX-License-Identifier: Apache-2.0
// Pictures or shapes as points: what metrics of sets of them work on.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// `rows` points of `width` coordinates, one after the other.
struct FeatureRows {
  std::vector<float> values;
  std::size_t width = 0;

  std::size_t rows() const { return width == 0 ? 0 : values.size() / width; }
  std::span<const float> Row(std::size_t i) const {
    return std::span(values).subspan(i * width, width);
  }
};

// InvalidArgument with `what` if there are fewer than `least` rows, values that fill no whole row,
// or one that is not finite.
Status CheckRows(const FeatureRows& rows, std::size_t least, const char* what);
// The same of two sets, which must also agree in width.
Status CheckPair(const FeatureRows& a, const FeatureRows& b, std::size_t least, const char* what);

// `count` of the rows, or all if there are fewer, drawn without replacement by `seed`.
FeatureRows DrawRows(const FeatureRows& from, std::size_t count, std::uint64_t seed);
// Rows [begin, end).
FeatureRows SliceRows(const FeatureRows& from, std::size_t begin, std::size_t end);

// Each column of `rows` minus its mean in `reference`, divided by its deviation there; a column
// that is constant there is set to 0.
FeatureRows Standardised(const FeatureRows& rows, const FeatureRows& reference);

// |a - b|^2 in double, in order.
double SquaredDistance(std::span<const float> a, std::span<const float> b);

}  // namespace tilegrad::train

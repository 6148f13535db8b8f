// SPDX-License-Identifier: Apache-2.0
// Fast predicates over whole arrays.
#pragma once

#include <cstdint>
#include <span>

namespace tilegrad {

bool AllFinite(std::span<const float> values);
bool AllFinite(std::span<const double> values);

// Whether |value| <= most for every value; false if any is NaN.
bool AllBelow(std::span<const float> values, float most);
bool AllBelow(std::span<const double> values, double most);

// Whether every value is in [least, end).
bool AllWithin(std::span<const std::int32_t> values, std::int32_t least, std::int32_t end);

}  // namespace tilegrad

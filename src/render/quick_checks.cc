// SPDX-License-Identifier: Apache-2.0
#include "render/quick_checks.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tilegrad {

namespace {

template <class T>
bool NoneIsInfiniteOrNan(std::span<const T> values) {
  // Sums of zeros, or of NaN where a value is not finite; several, so that they run side by side.
  constexpr std::size_t kSums = 16;
  T sums[kSums] = {};
  const std::size_t whole = values.size() / kSums * kSums;
  for (std::size_t i = 0; i < whole; i += kSums) {
    for (std::size_t k = 0; k < kSums; ++k) sums[k] += values[i + k] - values[i + k];
  }
  for (const T v : values.subspan(whole)) sums[0] += v - v;
  return std::all_of(sums, sums + kSums, [](T sum) { return sum == 0; });
}

}  // namespace

bool AllFinite(std::span<const float> values) { return NoneIsInfiniteOrNan(values); }
bool AllFinite(std::span<const double> values) { return NoneIsInfiniteOrNan(values); }

bool AllWithin(std::span<const std::int32_t> values, std::int32_t least, std::int32_t end) {
  std::int32_t outside = 0;
  for (const std::int32_t v : values) {
    outside |= static_cast<std::int32_t>(v < least) | static_cast<std::int32_t>(v >= end);
  }
  return outside == 0;
}

bool IsFiniteCamera(const Camera& camera) {
  const float numbers[5] = {camera.fx, camera.fy, camera.cx, camera.cy, camera.near_plane};
  return AllFinite(camera.rotation) && AllFinite(camera.translation) && AllFinite(numbers);
}

}  // namespace tilegrad

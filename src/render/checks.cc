// SPDX-License-Identifier: Apache-2.0
#include "render/checks.h"

#include <cmath>
#include <limits>

#include "base/array_checks.h"
#include "base/error.h"
#include "raster/conventions.h"

namespace tilegrad {
namespace {

template <class T>
Status FirstNotFinite(const char* array, std::span<const T> values) {
  if (AllFinite(values)) return {};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) return InvalidArgument("{}[{}] is {}", array, i, values[i]);
  }
  return {};
}

}  // namespace

std::string SceneName(std::size_t n) { return fmt::format("scene {}", n); }

Status CheckShape(const char* array, std::size_t got, std::size_t rows, std::size_t width) {
  if (got == rows * width) return {};
  return InvalidArgument("{} must be [{},{}], got {} numbers", array, rows, width, got);
}

Status CheckSize(const char* array, std::size_t got, std::size_t expected) {
  if (got == expected) return {};
  return InvalidArgument("{} has {} numbers, expected {}", array, got, expected);
}

Status CheckNotNegative(const char* name, double value) {
  if (value >= 0 && std::isfinite(value)) return {};
  return InvalidArgument("{} is {}, must be finite and >= 0", name, value);
}

Status CheckImageSize(const char* axis, int pixels) {
  if (pixels >= 1 && pixels <= raster::kMaxImageSize) return {};
  return InvalidArgument("options.{} is {}, must be in 1..{} pixels", axis, pixels,
                         raster::kMaxImageSize);
}

Status CheckFinite(const char* array, std::span<const float> values) {
  return FirstNotFinite(array, values);
}
Status CheckFinite(const char* array, std::span<const double> values) {
  return FirstNotFinite(array, values);
}

float InFloat(double x) {
  if (std::abs(x) <= std::numeric_limits<float>::max()) return static_cast<float>(x);
  return std::isnan(x) ? NAN : x > 0 ? INFINITY : -INFINITY;
}

Status CheckNumbers(const char* array, std::span<const float> values) {
  return CheckFinite(array, values);
}
Status CheckNumbers(const char* array, std::span<const double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float x = InFloat(values[i]);
    if (!std::isfinite(x)) return InvalidArgument("{}[{}] is {}", array, i, x);
  }
  return {};
}

}  // namespace tilegrad

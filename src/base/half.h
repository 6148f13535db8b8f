// SPDX-License-Identifier: Apache-2.0
// Converts the bits of IEEE 754 binary16 (float16) to and from float32.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace tilegrad {

inline constexpr std::uint16_t kHalfInfinity = 0x7c00;  // bits; larger magnitudes are NaN
inline constexpr float kLargestHalf = 65504;

// Exact: every float16 is a float32 with the exponent bias 127 instead of 15.
inline float FromHalf(std::uint16_t half) {
  const std::uint32_t bits = half, sign = (bits & 0x8000) << 16, exponent = bits >> 10 & 31,
                      fraction = bits & 1023;
  if (exponent == 0)
    return std::copysign(std::ldexp(static_cast<float>(fraction), -24),
                         std::bit_cast<float>(sign | 0x3f800000));
  const std::uint32_t wide = exponent == 31 ? 255 : exponent + 112;
  return std::bit_cast<float>(sign | wide << 23 | fraction << 13);
}

// Rounds to nearest, ties to even: 65520 and above become infinity, up to 2^-25 zero. NaN stays
// NaN.
inline std::uint16_t ToHalf(float value) {
  constexpr std::uint32_t kInfinity = 0x7f800000, kLeastNormal = 0x38800000;  // 2^-14
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value), magnitude = bits & 0x7fffffff;
  const auto sign = static_cast<std::uint16_t>(bits >> 16 & 0x8000);
  if (magnitude > kInfinity) return static_cast<std::uint16_t>(sign | kHalfInfinity | 0x200);
  if (magnitude < kLeastNormal) {  // in steps of 2^-24; the smallest normal half is 1024 of them
    const float steps = std::nearbyint(std::bit_cast<float>(magnitude) * 0x1p24f);
    return static_cast<std::uint16_t>(sign | static_cast<std::uint16_t>(steps));
  }
  // Drops 13 bits of the fraction; a carry out of it raises the exponent, as it should.
  const std::uint32_t rounded = (magnitude + 0xfff + (magnitude >> 13 & 1)) >> 13;
  constexpr std::uint32_t kBias = (127 - 15) << 10;
  const std::uint32_t half = rounded - kBias;
  return static_cast<std::uint16_t>(sign | (half < kHalfInfinity ? half : kHalfInfinity));
}

}  // namespace tilegrad

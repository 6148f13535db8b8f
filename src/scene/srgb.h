// SPDX-License-Identifier: Apache-2.0
// The sRGB transfer function (IEC 61966-2-1). Colours in a Mesh are sRGB-encoded, like the pixels
// of an image; the factors and vertex colours in a glTF file are linear.
#pragma once

#include <cmath>
#include <glm/vec4.hpp>

namespace tilegrad {

// In double, so that 0 and 1 are kept exactly.
inline float SrgbToLinear(float c) {
  return static_cast<float>(c <= 0.04045f ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
}
inline float LinearToSrgb(float c) {
  return static_cast<float>(c <= 0.0031308f ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055);
}

// Alpha is linear in both.
inline glm::vec4 SrgbToLinear(glm::vec4 c) {
  return {SrgbToLinear(c.r), SrgbToLinear(c.g), SrgbToLinear(c.b), c.a};
}
inline glm::vec4 LinearToSrgb(glm::vec4 c) {
  return {LinearToSrgb(c.r), LinearToSrgb(c.g), LinearToSrgb(c.b), c.a};
}

}  // namespace tilegrad

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec4.hpp>
#include <vector>

namespace tilegrad {

// An image that owns its pixels: interleaved, row 0 on top, [height][width][channels].
template <class T>
struct ImageT {
  int width = 0, height = 0, channels = 0;
  std::vector<T> pixels;

  ImageT() = default;
  ImageT(int w, int h, int c, T fill = T(0))
      : width(w), height(h), channels(c), pixels(static_cast<std::size_t>(w) * h * c, fill) {}
  T* at(int x, int y) { return &pixels[(static_cast<std::size_t>(y) * width + x) * channels]; }
  const T* at(int x, int y) const {
    return &pixels[(static_cast<std::size_t>(y) * width + x) * channels];
  }
  bool empty() const { return pixels.empty(); }
};
using Image = ImageT<float>;  // values in [0, 1], sRGB-encoded as in the file: training compares
                              // perceived colours
using ImageU8 = ImageT<std::uint8_t>;  // 0..255

// The sRGB transfer function (IEC 61966-2-1). Colours in a Mesh are sRGB-encoded, like the pixels
// of an image; the factors and vertex colours in a glTF file are linear.

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

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
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

}  // namespace tilegrad

// SPDX-License-Identifier: Apache-2.0
// Textures and where they are looked up, for tests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compat/nvdiffrast/test_util.h"
#include "compat/nvdiffrast/texture.h"

namespace tilegrad::compat::nvdiffrast {

// A texture with its pyramid, and where it is looked up.
template <class T>
struct Lookups {
  std::vector<Numbers<T>> levels;
  std::vector<MipSize> sizes;
  std::size_t textures = 1, channels = 1;
  TextureFilter filter = TextureFilter::kLinear;
  TextureBoundary boundary = TextureBoundary::kWrap;
  PixelGrid grid{1, 1, 1};
  Numbers<T> uv, uv_da, bias;
  std::vector<TextureLevel<T>> views;

  std::size_t faces() const { return boundary == TextureBoundary::kCube ? 6 : 1; }
  TextureInput<T> input() {
    views.clear();
    for (std::size_t l = 0; l < levels.size(); ++l) views.push_back({levels[l], sizes[l]});
    return {views, textures, channels, filter, boundary, grid, uv, uv_da, bias};
  }
  void Random(const MipSize& size, std::uint64_t seed) {
    sizes = MipSizes(size, -1).value();
    for (const MipSize& s : sizes) {
      levels.push_back(RandomNumbers<T>(
          textures * faces() * static_cast<std::size_t>(s.height * s.width) * channels, ++seed));
    }
  }
};

// The same numbers as T.
template <class T, class U>
Lookups<T> In(const Lookups<U>& from) {
  Lookups<T> out;
  for (const auto& level : from.levels) out.levels.push_back(As<T>(level));
  out.sizes = from.sizes;
  out.textures = from.textures;
  out.channels = from.channels;
  out.filter = from.filter;
  out.boundary = from.boundary;
  out.grid = from.grid;
  out.uv = As<T>(from.uv);
  out.uv_da = As<T>(from.uv_da);
  out.bias = As<T>(from.bias);
  return out;
}

template <class T>
Numbers<T> Sampled(Lookups<T>& lookups, const Workers& workers = Workers(1)) {
  Numbers<T> out(lookups.grid.pixels() * lookups.channels, T(-7));
  SampleTexture<T>(lookups.input(), workers, out);
  return out;
}

}  // namespace tilegrad::compat::nvdiffrast

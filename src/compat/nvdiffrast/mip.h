// SPDX-License-Identifier: Apache-2.0
// The pyramid of a texture: every level is half as wide and high as the one before, and each of its
// texels the mean of 2 x 2; a side of one texel stays one.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

struct MipSize {
  int height, width;
};

// One level of a stack of textures: [count][height][width][channels].
template <class T>
struct TextureLevel {
  std::span<const T> texels;
  MipSize size;
};

// The levels of a texture, itself first: down to one texel, or `most` levels below it if that is
// not negative. Error: a side that is odd and has to be halved.
Result<std::vector<MipSize>> MipSizes(const MipSize& base, int most);

// coarse [count][h'][w'][channels] <- the means of `fine`.
template <class T>
void HalveTexture(const TextureLevel<T>& fine, std::size_t channels, const Workers& workers,
                  std::span<T> coarse);
// d_fine += what d_coarse pulls; d_coarse has the size that follows d_fine's.
template <class T>
void HalveTextureBackward(const TextureLevel<T>& d_coarse, const MipSize& fine,
                          std::size_t channels, const Workers& workers, std::span<T> d_fine);

}  // namespace tilegrad::compat::nvdiffrast

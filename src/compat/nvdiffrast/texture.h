// SPDX-License-Identifier: Apache-2.0
// The third of nvdiffrast's operations (rasterize.h): filtered lookups into textures and cube maps.
//
// Textures are [N|1,H,W,C], row 0 at t = 0: the texel in column j and row i has its centre at s =
// (j + 0.5) / W, t = (i + 0.5) / H. Cube maps are [N|1,6,S,S,C], faces +x, -x, +y, -y, +z, -z with
// the axes of OpenGL; a linear filter reaches over the edge to the next face, and at a corner,
// where three faces meet, the missing texel is the mean of the other three.
//
// The mip level is that at which a texel is as large as the longer axis of the pixel's footprint:
// with J = d(s W, t H)/d(X, Y), level = log2 of the largest singular value of J, plus the bias,
// clamped to the existing levels. Without a footprint the bias alone is the level. Linear within
// the nearest level rounds the level down, as in nvdiffrast.
//
// Coordinates that are not finite, and the zero vector in a cube map, give zeros without gradient.
//
// float runs vector kernels in float, double scalar code (texture_ref.h). A level of a texture has
// less than 2^31 texels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

// Mip levels of a texture: every level is half as wide and high as the previous one, each texel the
// mean of 2 x 2; a side of one texel stays one.

struct MipSize {
  int height, width;
};

// One level of a stack of textures: [count][height][width][channels].
template <class T>
struct TextureLevel {
  std::span<const T> texels;
  MipSize size;
};

// The mip levels of a texture, starting with itself: down to one texel, or at most `most` further
// levels if that is not negative. Error: an odd side that must be halved.
Result<std::vector<MipSize>> MipSizes(const MipSize& base, int most);

// coarse [count][h'][w'][channels] <- the means of `fine`.
template <class T>
void HalveTexture(const TextureLevel<T>& fine, std::size_t channels, const Workers& workers,
                  std::span<T> coarse);
// d_fine += gradient from d_coarse; d_coarse has the size that follows from d_fine's.
template <class T>
void HalveTextureBackward(const TextureLevel<T>& d_coarse, const MipSize& fine,
                          std::size_t channels, const Workers& workers, std::span<T> d_fine);

enum class TextureFilter {
  kNearest,
  kLinear,
  kLinearMipmapNearest,  // linear within the level, rounded down
  kLinearMipmapLinear,   // and between two levels
};

enum class TextureBoundary {
  kWrap,   // the texture tiles the plane
  kClamp,  // coordinates are clamped to the centres of the border texels
  kZero,   // zeros outside
  kCube,   // a cube map
};

template <class T>
struct TextureInput {
  // Finest first, as in MipSizes; one level if the filter needs no more.
  std::span<const TextureLevel<T>> levels;
  std::size_t textures = 1;  // 1: shared by all images; or N
  std::size_t channels = 0;
  TextureFilter filter = TextureFilter::kLinear;
  TextureBoundary boundary = TextureBoundary::kWrap;
  PixelGrid grid;
  std::span<const T> uv;              // [N,H,W,2], for a cube map [N,H,W,3]
  std::span<const T> uv_da;           // [N,H,W,4|6] (ds/dX, ds/dY, dt/dX, ...), or empty
  std::span<const T> mip_level_bias;  // [N,H,W], or empty

  std::size_t coordinates() const { return boundary == TextureBoundary::kCube ? 3 : 2; }
  std::size_t faces() const { return boundary == TextureBoundary::kCube ? 6 : 1; }
};

// out [N,H,W,C].
template <class T>
void SampleTexture(const TextureInput<T>& input, const Workers& workers, std::span<T> out);

// Overwritten; empty ones are not computed.
template <class T>
struct TextureGradients {
  std::span<const std::span<T>> d_levels;  // shaped as the levels' texels; empty, or one per level
  std::span<T> d_uv, d_uv_da, d_mip_level_bias;

  bool HasCoordinates() const {
    return !d_uv.empty() || !d_uv_da.empty() || !d_mip_level_bias.empty();
  }
};

template <class T>
void SampleTextureBackward(const TextureInput<T>& input, std::span<const T> d_out,
                           const Workers& workers, const TextureGradients<T>& out);

inline std::size_t TexelsOf(const MipSize& size, std::size_t faces) {
  return faces * static_cast<std::size_t>(size.height) * static_cast<std::size_t>(size.width);
}

// The texels, of all levels, that one of several tasks sums.
struct TexelPart {
  std::uint32_t part = 0, parts = 1;
  float* const* levels = nullptr;  // gradients of an image's texture; null: not requested
};

}  // namespace tilegrad::compat::nvdiffrast

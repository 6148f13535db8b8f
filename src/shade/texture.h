// SPDX-License-Identifier: Apache-2.0
// Texture lookup: colour at (u, v), and its adjoint with respect to the coordinates and the texels.
//
// Texel (column j, row i) of a W x H texture has its centre at u = (j + 0.5) / W, v = 1 - (i + 0.5)
// / H: row 0 is the top, v goes up (docs/conventions.md). The bilinear filter interpolates the four
// nearest centres; its derivative is that of the cell containing the point, at the border of two
// cells that of the right (lower) one. The nearest texel is the one whose square contains the
// point; it has no gradient by the coordinates. The trilinear filter interpolates between two mip
// levels (texture_levels.h); derivatives hold the level constant, like the choice of texels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shade/pixel_run.h"
#include "tilegrad/scene.h"

namespace tilegrad::shade {

// A texture for kernels: [height][width][channels], width and height >= 1.
template <class T>
struct TextureViewT {
  std::span<const T> texels;
  int width = 0, height = 0, channels = 0;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
};
using TextureView = TextureViewT<float>;

template <class T>
TextureViewT<T> ViewOf(const TextureT<T>& t) {
  return {t.texels, t.width, t.height, 3, t.wrap, t.filter};
}

// The wrap modes along u and v: kRepeat, kClamp or kMirror.
constexpr Wrap WrapAlongU(Wrap wrap) { return static_cast<Wrap>(static_cast<int>(wrap) % 3); }
constexpr Wrap WrapAlongV(Wrap wrap) {
  const int way = static_cast<int>(wrap);
  return static_cast<Wrap>((way + way / 3) % 3);
}
// The Wrap that combines two such modes.
constexpr Wrap WrapOf(Wrap along_u, Wrap along_v) {
  const int u = static_cast<int>(along_u), v = static_cast<int>(along_v);
  return static_cast<Wrap>(u + 3 * ((v - u + 3) % 3));
}

inline constexpr int kMaxTextureSize = 16384;  // texels, each axis

// A mip level, prepared for lookups: texels [height][width][4], the fourth unused.
struct TextureLevel {
  const float* texels;
  int width, height;
};

struct TextureInput {
  std::span<const TextureLevel> levels;  // at least one; finest first
  Wrap wrap;
  Filter filter;
  const RunPlane* uv;     // [2]
  const RunPlane* level;  // if trilinear: log2 of texels per pixel, 0 is the finest; any number
};

// A pixel's gradient to up to four texels of a level: (1-a)(1-b), a(1-b), (1-a)b and ab of d_color
// on (x0, y0), (x1, y0), (x0, y1), (x1, y1).
struct TexelShare {
  std::uint16_t x0, x1, y0, y1;
  float a, b;
  float d_color[3];
  std::uint32_t level;
};

// Shares per lookup.
inline std::size_t SharesPerLookup(Filter filter) { return filter == Filter::kTrilinear ? 2 : 1; }

// color[3] <- the texture at the coordinates of a run.
void SampleTexture(std::size_t count, const TextureInput& input, RunPlane* color);

// Overwrites d_uv[2] and shares [count * SharesPerLookup], in pixel order; null: not requested.
void SampleTextureAdjoint(std::size_t count, const TextureInput& input, const RunPlane* d_color,
                          RunPlane* d_uv, TexelShare* shares);

}  // namespace tilegrad::shade

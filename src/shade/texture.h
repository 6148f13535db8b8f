// SPDX-License-Identifier: Apache-2.0
// Texture lookup: colour at (u, v), and its adjoint with respect to the coordinates and the texels.
//
// Texel (column j, row i) of a W x H texture has its centre at u = (j + 0.5) / W, v = 1 - (i + 0.5)
// / H: row 0 is the top, v goes up (docs/conventions.md). The bilinear filter interpolates the four
// nearest centres; its derivative is the one of the cell that holds the point, and at the border of
// two cells that of the right (lower) one.
#pragma once

#include <span>

#include "scene/image.h"

namespace tilegrad::shade {

enum class Wrap {
  kRepeat,  // the texture tiles the plane
  kClamp,   // outside [0, 1] the border texels go on
};

// Texels of the caller: [height][width][channels], width and height >= 1.
template <class T>
struct TextureViewT {
  std::span<const T> texels;
  int width = 0, height = 0, channels = 0;
  Wrap wrap = Wrap::kRepeat;
};

}  // namespace tilegrad::shade

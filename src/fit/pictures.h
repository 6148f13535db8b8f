// SPDX-License-Identifier: Apache-2.0
// Pictures of what a fit renders.
#pragma once

#include "render/frame_images.h"
#include "scene/image.h"

namespace tilegrad::train {

// Image `n` of a frame as RGB: colours where a face is drawn, white elsewhere.
ImageU8 OverWhite(const Images& frame, std::size_t n);

}  // namespace tilegrad::train

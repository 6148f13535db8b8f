// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/image.h"

namespace tilegrad {

// Box-filters an image down to at most `side` pixels a side; an image that fits is returned as it
// is.
ImageU8 ShrunkImage(const ImageU8& image, int side);

}  // namespace tilegrad

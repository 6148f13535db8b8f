// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/image.h"

namespace tilegrad {

// The mean of the pixels behind each of an image that has at most `side` pixels a side; the same
// image if it has them already.
ImageU8 ShrunkImage(const ImageU8& image, int side);

}  // namespace tilegrad

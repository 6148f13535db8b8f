// SPDX-License-Identifier: Apache-2.0
// Which way up an image is: cameras store the sensor's rows and say in a tag (Exif 2.32, 4.6.4,
// tag 274) how to turn them.
#pragma once

#include <cstdint>
#include <span>

#include "scene/image.h"

namespace tilegrad::io {

// 1 to 8, of a JPEG's Exif segment, a PNG's eXIf or a WebP's EXIF chunk; 1, upright, where there is
// none or it makes no sense. `bytes` may be anything.
int OrientationOf(std::span<const std::uint8_t> bytes);

// The image turned and mirrored so that it is upright. `orientation` is 1 to 8.
ImageU8 Upright(ImageU8 image, int orientation);

}  // namespace tilegrad::io

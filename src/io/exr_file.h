// SPDX-License-Identifier: Apache-2.0
// OpenEXR images out: float channels by name, lossless ZIP compression.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// Planes of one image, [height][width] each, row 0 on top. Names as EXR readers know them: R, G, B,
// A, Z; others are layers, "normal.X".
struct ExrChannel {
  std::string name;
  std::span<const float> values;
};
struct ExrImage {
  int width = 0, height = 0;
  std::vector<ExrChannel> channels;
};

// Errors: no pixel, no channel, a name that is empty or there twice, a plane of the wrong size.
Result<Bytes> EncodeExr(const ExrImage& image);
// Whole or not at all.
Status SaveExr(const Path& path, const ExrImage& image);

}  // namespace tilegrad::io

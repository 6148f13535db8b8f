// SPDX-License-Identifier: Apache-2.0
// OpenEXR images: float channels by name; written with lossless ZIP compression.
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

// Errors: no pixel, no channel, a name that is empty, there twice, longer than 255 bytes or with a
// NUL in it, a plane of the wrong size.
Result<Bytes> EncodeExr(const ExrImage& image);
// Whole or not at all.
Status SaveExr(const Path& path, const ExrImage& image);

struct LoadedExr {
  int width = 0, height = 0;
  std::vector<std::string> names;     // of channels, sorted as the library sorts them
  std::vector<float> values;          // [channels][height][width], row 0 on top
  std::vector<std::string> warnings;  // what of the file is left out
};

// The display window of the first part of a file: 0 where it has no data, and what it has outside
// is left out with a warning. Half and integer channels become float. The library works in a
// process of its own (guarded_process.h). `name` stands in messages. Errors: not an EXR, cut short
// or damaged, deep, a channel that is subsampled, more than kMaxImageSide pixels a side.
Result<LoadedExr> DecodeExr(std::span<const std::uint8_t> bytes, const std::string& name);
// From what that process hands over, which is untrusted: the library may have gone wrong.
Result<LoadedExr> ExrFromReader(std::span<const std::uint8_t> bytes);
Result<LoadedExr> LoadExr(const Path& path);

}  // namespace tilegrad::io

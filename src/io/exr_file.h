// SPDX-License-Identifier: Apache-2.0
// OpenEXR images: float channels by name; written with lossless ZIP compression.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// Planes of one image, [height][width] each, row 0 on top. Names by OpenEXR convention: R, G, B, A,
// Z; others are layers, "normal.X".
struct ExrChannel {
  std::string name;
  std::span<const float> values;
};

struct ExrImage {
  int width = 0, height = 0;
  std::vector<ExrChannel> channels;
};

// Errors: no pixels, no channels, a name that is empty, duplicate, longer than 255 bytes or
// contains NUL, a plane of the wrong size.
Result<Bytes> EncodeExr(const ExrImage& image);
// Atomic.
Status SaveExr(const Path& path, const ExrImage& image);

struct LoadedExr {
  int width = 0, height = 0;
  std::vector<std::string> names;     // of channels, sorted as the library sorts them
  std::vector<float> values;          // [channels][height][width], row 0 on top
  std::vector<std::string> warnings;  // parts of the file that were dropped
};

// The display window of the file's first part: 0 where it has no data; drops data outside with a
// warning. Half and integer channels become float. The library runs in a child process
// (guarded_process.h). Messages call the file `name`. Errors: not an EXR, truncated or damaged,
// deep, a subsampled channel, more than kMaxImageSide pixels a side.
Result<LoadedExr> DecodeExr(std::span<const std::uint8_t> bytes, const std::string& name);
// Decodes the child's output, which is untrusted: the library may have misbehaved.
Result<LoadedExr> ExrFromReader(std::span<const std::uint8_t> bytes);
Bytes ExrForReader(const Result<LoadedExr>& image);
Result<LoadedExr> LoadExr(const Path& path);

}  // namespace tilegrad::io

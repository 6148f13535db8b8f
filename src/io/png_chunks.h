// SPDX-License-Identifier: Apache-2.0
// Internal to io: the chunks of a PNG, each of which is length, type, data and a checksum (PNG,
// section 5.3).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "io/image_readers.h"

namespace tilegrad::io {

struct PngChunk {
  std::string_view type;
  std::span<const std::uint8_t> data;
};

// Iterates over chunks up to IEND; stops early at a chunk that exceeds the file. Ignores checksums.
class PngChunks {
 public:
  // `bytes` begin with a PNG's signature (IsPng).
  explicit PngChunks(std::span<const std::uint8_t> bytes) : rest_(bytes.subspan(kSignature)) {}

  bool Next(PngChunk& chunk) {
    if (chunk.type == "IEND" || rest_.size() < kFrame) return false;
    const std::size_t length = BigEndian(rest_.first(4));
    if (length > rest_.size() - kFrame) return false;
    chunk.type = {reinterpret_cast<const char*>(&rest_[4]), 4};
    chunk.data = rest_.subspan(8, length);
    rest_ = rest_.subspan(kFrame + length);
    return true;
  }

 private:
  static constexpr std::size_t kSignature = 8, kFrame = 12;
  std::span<const std::uint8_t> rest_;
};

}  // namespace tilegrad::io

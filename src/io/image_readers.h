// SPDX-License-Identifier: Apache-2.0
// Internal to io: formats that stb_image reads partly or not at all (Netpbm, SGI, WebP), and checks
// for those that it reads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::io {

// Binary PGM and PPM (P5, P6).
bool IsPnm(std::span<const std::uint8_t> bytes);

// 1 or 3 channels. Scales samples from [0, file's maximum <= 65535] to [0, 255]. Ignores what
// follows the first image. Messages call the file `name`.
Result<ImageU8> DecodePnm(std::span<const std::uint8_t> bytes, const std::string& name);

// SGI images (.rgb, .rgba, .bw, .sgi), the textures of old games and flight simulators: "The SGI
// Image File Format", version 1.00 (Paul Haeberli).
bool IsSgi(std::span<const std::uint8_t> bytes);

// 1 to 4 channels of 8 or 16 bits, raw or run-length encoded; 16 bits are scaled to 8. Row 0 of the
// result is on top; the file starts at the bottom. Refuses palettes (colour map codes other than
// 0). Messages call the file `name` and give the byte, or row and channel.
Result<ImageU8> DecodeSgi(std::span<const std::uint8_t> bytes, const std::string& name);

// Still images in WebP, by libwebp.

bool IsWebp(std::span<const std::uint8_t> bytes);

// 3 or 4 channels, as stored. Messages call the file `name`.
Result<ImageU8> DecodeWebp(std::span<const std::uint8_t> bytes, const std::string& name);

// Checks that stb_image omits. It ignores PNG checksums, so that a corrupt header
// gives a garbled picture; it fills the missing part of a truncated JPEG with grey, and that of
// other formats with whatever was in memory.

// At most four bytes as a number, most or least significant byte first.
std::uint32_t BigEndian(std::span<const std::uint8_t> bytes);
std::uint32_t LittleEndian(std::span<const std::uint8_t> bytes);

bool IsPng(std::span<const std::uint8_t> bytes);

// A part of a PNG: length, type, data and a checksum (PNG, section 5.3).
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

// Decodes a PNG with 8 bits per channel and neither palette, transparent colour nor interlacing: 1
// to 4 channels as in the file, with stb_image's pixels. Returns nothing for other and damaged PNGs
// and if out of memory; stb_image then reads or refuses the file. `bytes` must have passed
// CheckImageContainer and CheckImageSize.
std::optional<ImageU8> DecodePlainPng(std::span<const std::uint8_t> bytes);

// Accepts any number of filler bytes first, like stb_image.
bool IsJpeg(std::span<const std::uint8_t> bytes);

// OK for anything that is neither PNG nor JPEG. PNG: every chunk is complete with a correct
// checksum, and there is an end chunk. JPEG: every segment is complete, there is an end marker,
// Huffman tables have a size that stb_image supports, and there are at most 100 scans. Errors give
// `name` and the byte, or the sides of a PNG outside of [1, kMaxImageSide].
Status CheckImageContainer(std::span<const std::uint8_t> bytes, const std::string& name);

// Both sides within [1, kMaxImageSide].
Status CheckImageSize(std::int64_t width, std::int64_t height, const std::string& name);

// A PNG that passed CheckImageContainer, its palette padded with black to 256 colours; nullopt if
// it has none or a full one. stb_image 2.27 reads colours beyond the palette from uninitialised
// memory.
std::optional<Bytes> WithFullPalette(std::span<const std::uint8_t> bytes);

// Checks for BMP and TGA, which stb_image pads from uninitialised memory, that the file contains
// all pixels and the palette all their colours; OK for other formats. Expects a header that
// stb_image accepts.
Status CheckRawPixels(std::span<const std::uint8_t> bytes, int width, int height,
                      const std::string& name);

// The unsupported format ("GIF" and the like) by the first bytes, whatever the file's name. Empty
// for others.
std::string_view UnreadImageFormat(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io

// SPDX-License-Identifier: Apache-2.0
// BMP and TGA: checks that the pixels are there. Positions are where stb_image 2.27 reads them.
#include <algorithm>

#include "base/error.h"
#include "io/image_check.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

// A TGA's header, and that of a BMP up to its bits a pixel.
constexpr std::size_t kTgaHeader = 18, kBmpHeader = 30;

std::size_t LittleEndianAt(ByteSpan bytes, std::size_t at, int size) {
  std::size_t value = 0;
  for (int i = 0; i < size; ++i) value |= std::size_t{bytes[at + i]} << 8 * i;
  return value;
}

Status Truncated(const std::string& name, const char* format, std::size_t need, std::size_t have) {
  return DataLoss("{}: truncated {}: its pixels end at byte {} of {}", name, format, need, have);
}

// How many colours stb_image reads of a BMP's palette. Headers of 12 bytes have 3 bytes a colour,
// of which it leaves some out.
std::size_t ColorsOfBmp(std::size_t offset, std::size_t header) {
  const std::size_t before = header == 12 ? 14 + 24 : 14 + header;
  return offset < before ? 0 : (offset - before) / (header == 12 ? 3 : 4);
}

Status CheckBmp(ByteSpan bytes, std::size_t width, std::size_t height, const std::string& name) {
  if (bytes.size() < kBmpHeader) return Truncated(name, "BMP", kBmpHeader, bytes.size());
  const std::size_t offset = LittleEndianAt(bytes, 10, 4), header = LittleEndianAt(bytes, 14, 4),
                    bits = LittleEndianAt(bytes, header == 12 ? 24 : 28, 2);
  const std::size_t used = (width * bits + 7) / 8, row = (used + 3) / 4 * 4;
  const std::size_t end = offset + (height - 1) * row + used;
  if (end > bytes.size()) return Truncated(name, "BMP", end, bytes.size());
  const std::size_t colors = ColorsOfBmp(offset, header);
  // stb_image takes no other numbers of bits with a palette.
  if ((bits != 1 && bits != 4 && bits != 8) || colors >= std::size_t{1} << bits) return {};
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t bit = x * bits;
      const int byte = bytes[offset + y * row + bit / 8];
      const int index = byte >> (8 - bits - bit % 8) & ((1 << bits) - 1);
      if (static_cast<std::size_t>(index) >= colors)
        return DataLoss("{}: corrupt BMP: colour {} of a palette of {}", name, index, colors);
    }
  }
  return {};
}

// Packets of a head and 1 or as many pixels as it says; they may cross rows.
std::size_t EndOfPackets(ByteSpan bytes, std::size_t at, std::size_t pixels,
                         std::size_t pixel_bytes) {
  while (pixels > 0 && at < bytes.size()) {
    const std::size_t count = (bytes[at] & 127) + std::size_t{1};
    at += 1 + pixel_bytes * (bytes[at] >= 128 ? 1 : std::min(count, pixels));
    pixels -= std::min(count, pixels);
  }
  return pixels > 0 ? at + 1 : at;
}

Status CheckTga(ByteSpan bytes, std::size_t pixels, const std::string& name) {
  if (bytes.size() < kTgaHeader) return Truncated(name, "TGA", kTgaHeader, bytes.size());
  const bool palette = bytes[1] != 0, packed = bytes[2] >= 8;
  const std::size_t bits = bytes[16], bytes_of_color = (bytes[7] + std::size_t{7}) / 8;
  std::size_t at = kTgaHeader + bytes[0];
  if (palette) at += LittleEndianAt(bytes, 3, 2) + LittleEndianAt(bytes, 5, 2) * bytes_of_color;
  const std::size_t pixel_bytes = palette ? (bits == 8 ? 1 : 2) : (bits + 7) / 8;
  const std::size_t end =
      packed ? EndOfPackets(bytes, at, pixels, pixel_bytes) : at + pixels * pixel_bytes;
  return end > bytes.size() ? Truncated(name, "TGA", end, bytes.size()) : Status();
}

}  // namespace

Status CheckRawPixels(ByteSpan bytes, int width, int height, const std::string& name) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  if (IsPng(bytes) || IsJpeg(bytes)) return {};
  if (bytes.size() > 1 && bytes[0] == 'B' && bytes[1] == 'M') return CheckBmp(bytes, w, h, name);
  return CheckTga(bytes, w * h, name);
}

}  // namespace tilegrad::io

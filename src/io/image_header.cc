// SPDX-License-Identifier: Apache-2.0
#include "io/image_header.h"

#include <array>
#include <cstddef>
#include <cstdlib>

#include "io/image_check.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

std::uint32_t LittleEndian(ByteSpan bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | bytes[i];
  return value;
}

// After the signature, the first chunk: length, "IHDR", width, height.
std::optional<HeaderSize> PngSize(ByteSpan bytes) {
  if (bytes.size() < 24) return std::nullopt;
  return HeaderSize{BigEndian(bytes.subspan(16, 4)), BigEndian(bytes.subspan(20, 4))};
}

// The frame's segment (T.81, B.2.2): length, precision, height, width.
std::optional<HeaderSize> JpegSize(ByteSpan bytes) {
  const auto is_frame = [](int marker) {
    return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
  };
  for (std::size_t at = 0; at + 9 < bytes.size();) {
    const int marker = bytes[at + 1];
    const bool alone = marker == 0xd8 || marker == 0xff;  // start of image, filler
    if (bytes[at] != 0xff) return std::nullopt;
    if (is_frame(marker)) {
      return HeaderSize{BigEndian(bytes.subspan(at + 7, 2)), BigEndian(bytes.subspan(at + 5, 2))};
    }
    at += alone ? (marker == 0xff ? 1 : 2) : 2 + BigEndian(bytes.subspan(at + 2, 2));
  }
  return std::nullopt;
}

// The header's own length at byte 14 tells whether sides have two bytes or four; a negative height
// has the first row on top.
std::optional<HeaderSize> BmpSize(ByteSpan bytes) {
  if (bytes.size() < 26) return std::nullopt;
  if (LittleEndian(bytes.subspan(14, 4)) == 12) {
    return HeaderSize{LittleEndian(bytes.subspan(18, 2)), LittleEndian(bytes.subspan(20, 2))};
  }
  const auto side = [&](std::size_t at) {
    return std::int64_t{static_cast<std::int32_t>(LittleEndian(bytes.subspan(at, 4)))};
  };
  return HeaderSize{side(18), std::abs(side(22))};
}

// A TGA has no signature: types, palettes and depths that there are.
std::optional<HeaderSize> TgaSize(ByteSpan bytes) {
  if (bytes.size() < 18) return std::nullopt;
  const int type = bytes[2] & ~8, depth = bytes[16];  // 8: compressed
  const bool good = bytes[1] <= 1 && type >= 1 && type <= 3 &&
                    (depth == 8 || depth == 15 || depth == 16 || depth == 24 || depth == 32);
  if (!good) return std::nullopt;
  return HeaderSize{LittleEndian(bytes.subspan(12, 2)), LittleEndian(bytes.subspan(14, 2))};
}

}  // namespace

std::uint32_t BigEndian(std::span<const std::uint8_t> bytes) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

std::optional<HeaderSize> ImageHeaderSize(ByteSpan bytes) {
  if (IsPng(bytes)) return PngSize(bytes);
  if (IsJpeg(bytes)) return JpegSize(bytes);
  if (bytes.size() > 2 && bytes[0] == 'B' && bytes[1] == 'M') return BmpSize(bytes);
  return TgaSize(bytes);
}

std::string_view UnreadImageFormat(std::span<const std::uint8_t> bytes) {
  struct Format {
    std::string_view name, begins;
    std::size_t at = 0;
  };
  using namespace std::string_view_literals;
  constexpr std::array<Format, 17> kFormats = {{{"WebP (.webp)", "WEBP", 8},
                                                {"AVIF", "ftypavif", 4},
                                                {"HEIC", "ftyphei", 4},
                                                {"HEIC", "ftypmif", 4},
                                                {"GIF", "GIF8"},
                                                {"TIFF", "II*\0"sv},
                                                {"TIFF", "MM\0*"sv},
                                                {"DDS", "DDS "},
                                                {"KTX", "\xABKTX "},
                                                {"Radiance HDR", "#?R"},
                                                {"Photoshop", "8BPS"},
                                                {"JPEG 2000", "jP  ", 4},
                                                {"JPEG XL", "JXL ", 4},
                                                {"text or bitmap PNM", "P1"},
                                                {"text or bitmap PNM", "P2"},
                                                {"text or bitmap PNM", "P3"},
                                                {"text or bitmap PNM", "P4"}}};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const Format& format : kFormats) {
    if (text.size() > format.at && text.substr(format.at).starts_with(format.begins))
      return format.name;
  }
  return text.starts_with("<svg") || text.starts_with("<?xml") ? "SVG" : "";
}

}  // namespace tilegrad::io

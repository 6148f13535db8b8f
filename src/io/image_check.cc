// SPDX-License-Identifier: Apache-2.0
#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <ranges>
#include <string_view>

#include "base/error.h"
#include "io/image_file.h"
#include "io/image_readers.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

// A chunk is length, type, data, CRC-32 of type and data (PNG, section 5.3).
Status CheckPng(ByteSpan bytes, const std::string& name) {
  constexpr std::size_t kFrame = 12;
  std::size_t at = kPngSignature.size();
  while (bytes.size() - at >= kFrame) {
    const std::size_t length = BigEndian(bytes.subspan(at, 4));
    const std::string_view type(reinterpret_cast<const char*>(&bytes[at + 4]), 4);
    if (length > bytes.size() - at - kFrame) {
      return DataLoss("{}: truncated or corrupt PNG: the chunk at byte {} claims {} bytes", name,
                      at, length);
    }
    const auto crc = libdeflate_crc32(0, &bytes[at + 4], length + 4);
    if (crc != BigEndian(bytes.subspan(at + 8 + length, 4)))
      return DataLoss("{}: corrupt PNG: the checksum of the chunk at byte {} is wrong", name, at);
    if (type == "IEND") return {};
    if (type == "IHDR" && length >= 8) {
      const auto header = bytes.subspan(at + 8, 8);
      TILEGRAD_TRY(CheckImageSize(BigEndian(header.first(4)), BigEndian(header.last(4)), name));
    }
    if (type == "CgBI") {  // blue before red, premultiplied alpha: stb_image corrects neither
      return DataLoss("{}: an Xcode PNG (CgBI), which is not read; save it as a standard PNG",
                      name);
    }
    at += kFrame + length;
  }
  return DataLoss("{}: truncated PNG: it ends without an end chunk", name);
}

constexpr int kApp14 = 0xee, kHuffmanTables = 0xc4, kStartOfScan = 0xda, kStartOfImage = 0xd8,
              kEndOfImage = 0xd9;

// Files have about ten. Each covers the whole picture, even if it takes a few bytes: stb_image took
// 5 s for 100 scans of 16,000 x 16,000 pixels in 25 kB.
constexpr int kMostScans = 100;

// Tables of a class and number, 16 counts of codes by length, and as many values as the counts'
// sum, which is at most 256 (T.81, B.2.4.2): stb_image 2.27 writes past its arrays if not.
bool HuffmanTablesFit(ByteSpan segment) {
  constexpr std::size_t kFixed = 17;
  while (!segment.empty()) {
    if (segment.size() < kFixed) return false;
    const auto counts = segment.subspan(1, kFixed - 1);
    const std::size_t values = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
    if (values > 256 || values > segment.size() - kFixed) return false;
    segment = segment.subspan(kFixed + values);
  }
  return true;
}

// SOF0 to SOF2, the frames that stb_image reads.
bool IsFrame(int marker) { return marker >= 0xc0 && marker <= 0xc2; }

// Determines the colour space of a JPEG's components.
struct JpegColors {
  int components = 0;
  int transform = -1;  // of the Adobe segment

  void Take(int marker, ByteSpan segment) {
    constexpr std::string_view kAdobe = "Adobe";
    if (IsFrame(marker) && segment.size() > 5) components = segment[5];
    if (marker == kApp14 && segment.size() >= 12 &&
        std::equal(kAdobe.begin(), kAdobe.end(), segment.begin())) {
      transform = segment[11];
    }
  }
  // Four components are CMYK (0) or YCCK (2), both inverted, if that segment exists. Without it
  // they may be inverted or not; stb_image takes them for YCbCr.
  Status Check(const std::string& name) const {
    if (components != 4 || transform == 0 || transform == 2) return {};
    return DataLoss(
        "{}: a JPEG of four components that does not say whether they are CMYK or inverted CMYK; "
        "save it as RGB",
        name);
  }
};

// Markers without a segment: TEM, RST0 to RST7, SOI.
bool HasNoSegment(int marker) { return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8); }

// The position of the next marker's code: after 0xff that is neither stuffed (0x00) nor filler.
std::size_t NextMarker(ByteSpan bytes, std::size_t at) {
  while (at + 1 < bytes.size() &&
         !(bytes[at] == 0xff && bytes[at + 1] != 0x00 && bytes[at + 1] != 0xff))
    ++at;
  return at + 1;
}

Status CheckJpeg(ByteSpan bytes, const std::string& name) {
  int scans = 0;
  JpegColors colors;
  std::size_t at = NextMarker(bytes, 0);
  for (; at < bytes.size(); at = NextMarker(bytes, at)) {
    const int marker = bytes[at++];
    if (marker == kEndOfImage) return colors.Check(name);
    if (HasNoSegment(marker)) continue;
    const std::size_t length = bytes.size() - at < 2 ? 0 : bytes[at] << 8 | bytes[at + 1];
    if (length < 2 || length > bytes.size() - at) {
      return DataLoss(
          "{}: truncated or corrupt JPEG: the segment at byte {} reaches beyond the end", name, at);
    }
    colors.Take(marker, bytes.subspan(at + 2, length - 2));
    if (marker == kHuffmanTables && !HuffmanTablesFit(bytes.subspan(at + 2, length - 2)))
      return DataLoss("{}: corrupt JPEG: the Huffman tables at byte {} are too long", name, at);
    if (marker == kStartOfScan && ++scans > kMostScans)
      return DataLoss("{}: a JPEG of more than {} scans", name, kMostScans);
    at += length;  // after a scan's header follows its data, in which NextMarker finds the end
  }
  return DataLoss("{}: truncated JPEG: it ends without an end marker", name);
}

// BMP and TGA: positions are where stb_image 2.27 reads them.

// A TGA's header, and that of a BMP up to its bits per pixel.
constexpr std::size_t kTgaHeader = 18, kBmpHeader = 30;

Status Truncated(const std::string& name, const char* format, std::size_t need, std::size_t have) {
  return DataLoss("{}: truncated {}: its pixels end at byte {} of {}", name, format, need, have);
}

// Number of colours that stb_image reads of a BMP's palette. With 12-byte headers a colour has 3
// bytes, and it skips some colours.
std::size_t ColorsOfBmp(std::size_t offset, std::size_t header) {
  const std::size_t before = header == 12 ? 14 + 24 : 14 + header;
  return offset < before ? 0 : (offset - before) / (header == 12 ? 3 : 4);
}

Status CheckBmp(ByteSpan bytes, std::size_t width, std::size_t height, const std::string& name) {
  if (bytes.size() < kBmpHeader) return Truncated(name, "BMP", kBmpHeader, bytes.size());
  const std::size_t offset = LittleEndian(bytes.subspan(10, 4)),
                    header = LittleEndian(bytes.subspan(14, 4)),
                    bits = LittleEndian(bytes.subspan(header == 12 ? 24 : 28, 2));
  const std::size_t used = (width * bits + 7) / 8, row = (used + 3) / 4 * 4;
  const std::size_t end = offset + (height - 1) * row + used;
  if (end > bytes.size()) return Truncated(name, "BMP", end, bytes.size());
  const std::size_t colors = ColorsOfBmp(offset, header);
  // stb_image supports no other bit depths with a palette.
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

// Packets of a head and one pixel, or as many as it says; they may cross rows.
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
  if (palette)
    at += LittleEndian(bytes.subspan(3, 2)) + LittleEndian(bytes.subspan(5, 2)) * bytes_of_color;
  const std::size_t pixel_bytes = palette ? (bits == 8 ? 1 : 2) : (bits + 7) / 8;
  const std::size_t end =
      packed ? EndOfPackets(bytes, at, pixels, pixel_bytes) : at + pixels * pixel_bytes;
  return end > bytes.size() ? Truncated(name, "TGA", end, bytes.size()) : Status();
}

}  // namespace

std::uint32_t BigEndian(ByteSpan bytes) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

std::uint32_t LittleEndian(ByteSpan bytes) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : std::views::reverse(bytes)) value = value << 8 | byte;
  return value;
}

bool IsPng(ByteSpan bytes) {
  return bytes.size() >= kPngSignature.size() &&
         std::equal(kPngSignature.begin(), kPngSignature.end(), bytes.begin());
}

bool IsJpeg(ByteSpan bytes) {
  const auto code = std::find_if(bytes.begin(), bytes.end(), [](int byte) { return byte != 0xff; });
  return code != bytes.begin() && code != bytes.end() && *code == kStartOfImage;
}

Status CheckImageContainer(ByteSpan bytes, const std::string& name) {
  if (IsPng(bytes)) return CheckPng(bytes, name);
  if (IsJpeg(bytes)) return CheckJpeg(bytes, name);
  return {};
}

Status CheckImageSize(std::int64_t width, std::int64_t height, const std::string& name) {
  if (width >= 1 && height >= 1 && width <= kMaxImageSide && height <= kMaxImageSide) return {};
  return DataLoss("{}: the header says {} x {} pixels; at most {} a side are read", name, width,
                  height, kMaxImageSide);
}

std::optional<Bytes> WithFullPalette(ByteSpan bytes) {
  constexpr std::size_t kFull = 3 * 256;
  if (!IsPng(bytes)) return std::nullopt;
  PngChunk chunk;
  for (PngChunks chunks(bytes); chunks.Next(chunk);) {
    if (chunk.type != "PLTE") continue;
    if (chunk.data.size() >= kFull) return std::nullopt;
    const auto at = chunk.data.data() - bytes.data();
    const auto end = at + std::ssize(chunk.data);
    Bytes out(bytes.begin(), bytes.end());
    out.insert(out.begin() + end, kFull - chunk.data.size(), 0);
    out[static_cast<std::size_t>(at) - 6] = kFull >> 8;
    out[static_cast<std::size_t>(at) - 5] = kFull & 0xff;  // stb_image ignores checksums
    return out;
  }
  return std::nullopt;
}

Status CheckRawPixels(ByteSpan bytes, int width, int height, const std::string& name) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  if (IsPng(bytes) || IsJpeg(bytes)) return {};
  if (bytes.size() > 1 && bytes[0] == 'B' && bytes[1] == 'M') return CheckBmp(bytes, w, h, name);
  return CheckTga(bytes, w * h, name);
}

std::string_view UnreadImageFormat(ByteSpan bytes) {
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

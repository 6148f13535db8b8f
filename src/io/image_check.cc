// SPDX-License-Identifier: Apache-2.0
#include "io/image_check.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

#include "base/error.h"
#include "io/image_file.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

std::uint32_t BigEndian32(const std::uint8_t* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3];
}

// A chunk is length, type, data, CRC-32 of type and data (PNG, section 5.3).
Status CheckPng(ByteSpan bytes, const std::string& name) {
  constexpr std::size_t kFrame = 12;
  std::size_t at = kPngSignature.size();
  while (bytes.size() - at >= kFrame) {
    const std::size_t length = BigEndian32(&bytes[at]);
    const std::string_view type(reinterpret_cast<const char*>(&bytes[at + 4]), 4);
    if (length > bytes.size() - at - kFrame) {
      return DataLoss("{}: truncated or corrupt PNG: the chunk at byte {} claims {} bytes", name,
                      at, length);
    }
    const auto crc = crc32_z(0, &bytes[at + 4], length + 4);
    if (crc != BigEndian32(&bytes[at + 8 + length]))
      return DataLoss("{}: corrupt PNG: the checksum of the chunk at byte {} is wrong", name, at);
    if (type == "IEND") return {};
    if (type == "CgBI") {  // blue before red, colours multiplied by alpha: stb_image leaves both so
      return DataLoss("{}: an Xcode PNG (CgBI), which is not read; save it as a standard PNG",
                      name);
    }
    at += kFrame + length;
  }
  return DataLoss("{}: truncated PNG: it ends without an end chunk", name);
}

constexpr int kApp14 = 0xee, kHuffmanTables = 0xc4, kStartOfScan = 0xda, kStartOfImage = 0xd8,
              kEndOfImage = 0xd9;

// Files have about ten. Each goes over the whole picture, even if it takes a few bytes: stb_image
// took 5 s for 100 scans of 16,000 x 16,000 pixels in 25 kB.
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

// What says how a JPEG's components are to be read as colours.
struct JpegColors {
  int components = 0;
  int transform = -1;  // of the segment that Adobe's programs write

  void Take(int marker, ByteSpan segment) {
    constexpr std::string_view kAdobe = "Adobe";
    if (IsFrame(marker) && segment.size() > 5) components = segment[5];
    if (marker == kApp14 && segment.size() >= 12 &&
        std::equal(kAdobe.begin(), kAdobe.end(), segment.begin())) {
      transform = segment[11];
    }
  }
  // Four components are CMYK (0) or YCCK (2), both inverted, if that segment is there. Without it
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

}  // namespace

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
  constexpr std::size_t kFrame = 12, kFull = 3 * 256;
  if (!IsPng(bytes)) return std::nullopt;
  for (std::size_t at = kPngSignature.size();;) {  // CheckPng has seen an end
    const std::size_t length = BigEndian32(&bytes[at]);
    const std::string_view type(reinterpret_cast<const char*>(&bytes[at + 4]), 4);
    if (type == "IEND" || (type == "PLTE" && length >= kFull)) return std::nullopt;
    if (type == "PLTE") {
      Bytes out(bytes.begin(), bytes.end());
      out.insert(out.begin() + static_cast<std::ptrdiff_t>(at + 8 + length), kFull - length, 0);
      out[at + 2] = kFull >> 8;
      out[at + 3] = kFull & 0xff;  // stb_image looks at no checksum
      return out;
    }
    at += kFrame + length;
  }
}

}  // namespace tilegrad::io

// SPDX-License-Identifier: Apache-2.0
#include "io/image_check.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

#include "base/error.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<std::uint8_t, 3> kJpegSignature = {0xff, 0xd8, 0xff};

template <class Signature>
bool StartsWith(ByteSpan bytes, const Signature& signature) {
  return bytes.size() >= signature.size() &&
         std::equal(signature.begin(), signature.end(), bytes.begin());
}

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
    at += kFrame + length;
  }
  return DataLoss("{}: truncated PNG: it ends without an end chunk", name);
}

constexpr int kHuffmanTables = 0xc4, kEndOfImage = 0xd9;

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

// Markers without a segment: TEM, RST0 to RST7, SOI.
bool StandsAlone(int marker) { return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8); }

// The position of the next marker's code: after 0xff that is neither stuffed (0x00) nor filler.
std::size_t NextMarker(ByteSpan bytes, std::size_t at) {
  while (at + 1 < bytes.size() &&
         !(bytes[at] == 0xff && bytes[at + 1] != 0x00 && bytes[at + 1] != 0xff))
    ++at;
  return at + 1;
}

Status CheckJpeg(ByteSpan bytes, const std::string& name) {
  std::size_t at = NextMarker(bytes, 2);
  for (; at < bytes.size(); at = NextMarker(bytes, at)) {
    const int marker = bytes[at++];
    if (marker == kEndOfImage) return {};
    if (StandsAlone(marker)) continue;
    const std::size_t length = bytes.size() - at < 2 ? 0 : bytes[at] << 8 | bytes[at + 1];
    if (length < 2 || length > bytes.size() - at) {
      return DataLoss(
          "{}: truncated or corrupt JPEG: the segment at byte {} reaches beyond the end", name, at);
    }
    if (marker == kHuffmanTables && !HuffmanTablesFit(bytes.subspan(at + 2, length - 2)))
      return DataLoss("{}: corrupt JPEG: the Huffman tables at byte {} are too long", name, at);
    at += length;  // after a scan's header follows its data, in which NextMarker finds the end
  }
  return DataLoss("{}: truncated JPEG: it ends without an end marker", name);
}

// Numbers in the header that stb_image's int does not hold: it would take what is left of them.
Status CheckPnm(ByteSpan bytes, const std::string& name) {
  constexpr int kNumbers = 3, kMost = 100'000'000;
  int value = 0, seen = 0;
  bool inside = false, comment = false;
  for (std::size_t at = 2; at < bytes.size() && seen < kNumbers; ++at) {
    const std::uint8_t c = bytes[at];
    if (comment) {
      comment = c != '\n' && c != '\r';
    } else if (c >= '0' && c <= '9') {
      value = (inside ? value * 10 : 0) + (c - '0');
      inside = true;
      if (value > kMost) return DataLoss("{}: corrupt PNM: a number at byte {} is huge", name, at);
    } else {
      seen += inside ? 1 : 0;
      inside = false;
      comment = c == '#';
    }
  }
  return {};
}

}  // namespace

Status CheckImageContainer(ByteSpan bytes, const std::string& name) {
  if (StartsWith(bytes, kPngSignature)) return CheckPng(bytes, name);
  if (StartsWith(bytes, kJpegSignature)) return CheckJpeg(bytes, name);
  if (bytes.size() > 2 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6')) {
    return CheckPnm(bytes, name);
  }
  return {};
}

}  // namespace tilegrad::io

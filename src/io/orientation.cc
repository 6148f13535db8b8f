// SPDX-License-Identifier: Apache-2.0
#include "io/orientation.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "io/image_check.h"
#include "io/webp_reader.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

// `count` bytes from `at`, or nothing if they are not there.
ByteSpan Part(ByteSpan bytes, std::size_t at, std::size_t count) {
  return at <= bytes.size() && count <= bytes.size() - at ? bytes.subspan(at, count) : ByteSpan();
}

bool Is(ByteSpan bytes, std::string_view text) {
  return bytes.size() == text.size() && std::equal(bytes.begin(), bytes.end(), text.begin(),
                                                   [](int a, char c) { return a == (c & 0xff); });
}

// Of a TIFF header with its first directory (TIFF 6.0, section 2).
int OrientationOfTiff(ByteSpan tiff) {
  constexpr std::uint32_t kTag = 274, kShort = 3;
  constexpr std::size_t kEntry = 12;
  const bool big = Is(Part(tiff, 0, 4), std::string_view("MM\0\x2a", 4));
  if (!big && !Is(Part(tiff, 0, 4), std::string_view("II\x2a\0", 4))) return 1;
  const auto at = [&](std::size_t offset, std::size_t size) {
    const ByteSpan number = Part(tiff, offset, size);
    return big ? BigEndian(number) : LittleEndian(number);
  };
  const std::size_t folder = at(4, 4), count = at(folder, 2);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = folder + 2 + kEntry * i;
    if (Part(tiff, entry, kEntry).empty()) return 1;
    if (at(entry, 2) != kTag || at(entry + 2, 2) != kShort) continue;
    const std::uint32_t value = at(entry + 8, 2);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

int OrientationOfJpeg(ByteSpan bytes) {
  constexpr int kApp1 = 0xe1, kStartOfScan = 0xda;
  constexpr std::string_view kExif("Exif\0\0", 6);
  // Marker, length, content; the start of image has no length. 0xff may be repeated before a
  // marker.
  for (std::size_t at = 2; at + 4 <= bytes.size();) {
    if (bytes[at] != 0xff) return 1;
    const int marker = bytes[at + 1];
    if (marker == 0xff) {
      ++at;
      continue;
    }
    const std::size_t length = BigEndian(bytes.subspan(at + 2, 2));
    if (marker == kStartOfScan || length < 2) return 1;
    const ByteSpan content = Part(bytes, at + 4, length - 2);
    if (marker == kApp1 && Is(Part(content, 0, kExif.size()), kExif))
      return OrientationOfTiff(content.subspan(kExif.size()));
    at += 2 + length;
  }
  return 1;
}

int OrientationOfPng(ByteSpan bytes) {
  constexpr std::size_t kSignature = 8, kFrame = 12;
  for (std::size_t at = kSignature; at + kFrame <= bytes.size();) {
    const std::size_t length = BigEndian(bytes.subspan(at, 4));
    const ByteSpan type = bytes.subspan(at + 4, 4);
    if (Is(type, "eXIf")) return OrientationOfTiff(Part(bytes, at + 8, length));
    if (Is(type, "IEND")) return 1;
    at += kFrame + length;
  }
  return 1;
}

// A header of 12 bytes, then chunks of an even number of bytes each: name, length, content. Some
// programs begin the content as a JPEG's segment does.
int OrientationOfWebp(ByteSpan bytes) {
  constexpr std::size_t kHeader = 12, kFrame = 8;
  constexpr std::string_view kExif("Exif\0\0", 6);
  for (std::size_t at = kHeader; at + kFrame <= bytes.size();) {
    const std::size_t length = LittleEndian(bytes.subspan(at + 4, 4));
    ByteSpan content = Part(bytes, at + kFrame, length);
    if (Is(bytes.subspan(at, 4), "EXIF")) {
      if (Is(Part(content, 0, kExif.size()), kExif)) content = content.subspan(kExif.size());
      return OrientationOfTiff(content);
    }
    at += kFrame + length + length % 2;
  }
  return 1;
}

}  // namespace

int OrientationOf(ByteSpan bytes) {
  if (IsPng(bytes)) return OrientationOfPng(bytes);
  if (IsWebp(bytes)) return OrientationOfWebp(bytes);
  return IsJpeg(bytes) ? OrientationOfJpeg(bytes) : 1;
}

ImageU8 Upright(ImageU8 image, int orientation) {
  if (orientation <= 1) return image;
  const bool turned = orientation >= 5;  // rows become columns
  const int w = image.width, h = image.height;
  ImageU8 out(turned ? h : w, turned ? w : h, image.channels);
  // Where the stored image is read backwards, along its own rows and columns.
  const bool back_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool back_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const int along = turned ? y : x, down = turned ? x : y;
      const std::uint8_t* from =
          image.at(back_x ? w - 1 - along : along, back_y ? h - 1 - down : down);
      std::copy_n(from, image.channels, out.at(x, y));
    }
  }
  return out;
}

}  // namespace tilegrad::io

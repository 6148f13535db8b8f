// SPDX-License-Identifier: Apache-2.0
// The common kinds of PNG by libdeflate, in half the time of stb_image.
#include <libdeflate.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>
#include <vector>

#include "io/image_readers.h"

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

struct PlainPng {
  int width = 0, height = 0, channels = 0;
  std::vector<ByteSpan> parts;  // of the compressed rows

  std::size_t RowBytes() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(channels);
  }
};

// 0 for colour types that use a palette, or that there are not (PNG, section 11.2.2).
int ChannelsOf(int color_type) {
  constexpr int kChannels[] = {1, 0, 3, 0, 2, 0, 4};
  return color_type < static_cast<int>(std::size(kChannels)) ? kChannels[color_type] : 0;
}

bool ReadHeader(ByteSpan header, PlainPng& out) {
  constexpr std::size_t kSize = 13, kBits = 8;
  if (header.size() != kSize || header[kBits] != 8) return false;
  if (std::any_of(header.begin() + 10, header.end(), [](int method) { return method != 0; }))
    return false;
  out.width = static_cast<int>(BigEndian(header.first(4)));
  out.height = static_cast<int>(BigEndian(header.subspan(4, 4)));
  out.channels = ChannelsOf(header[9]);
  return out.channels > 0;
}

// Those with a small first letter may be passed over, but tRNS adds a channel.
bool ChangesNothing(std::string_view type) { return (type[0] & 0x20) != 0 && type != "tRNS"; }

std::optional<PlainPng> ReadChunks(ByteSpan bytes) {
  PlainPng png;
  PngChunk chunk;
  PngChunks chunks(bytes);
  if (!chunks.Next(chunk) || chunk.type != "IHDR" || !ReadHeader(chunk.data, png))
    return std::nullopt;
  while (chunks.Next(chunk)) {
    if (chunk.type == "IEND") return png;
    if (chunk.type == "IDAT")
      png.parts.push_back(chunk.data);
    else if (!ChangesNothing(chunk.type))
      return std::nullopt;
  }
  return std::nullopt;
}

Bytes Joined(const std::vector<ByteSpan>& parts) {
  Bytes all;
  for (const ByteSpan part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

using Decompressor =
    std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>;

// Whether the stream is whole and unpacks to exactly these bytes, with the right checksum.
bool Unpack(ByteSpan stream, std::span<std::uint8_t> out) {
  const Decompressor with(libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  return with && libdeflate_zlib_decompress(with.get(), stream.data(), stream.size(), out.data(),
                                            out.size(), nullptr) == LIBDEFLATE_SUCCESS;
}

// How a row was changed before it was compressed: against the byte of the pixel on the left, of
// that above, and of that above on the left (PNG, section 9.2).
int Left(int left, int /*above*/, int /*corner*/) { return left; }
int Above(int /*left*/, int above, int /*corner*/) { return above; }
int Average(int left, int above, int /*corner*/) { return (left + above) / 2; }
int Paeth(int left, int above, int corner) {
  const int guess = left + above - corner;
  const int to_left = std::abs(guess - left), to_above = std::abs(guess - above),
            to_corner = std::abs(guess - corner);
  if (to_left <= to_above && to_left <= to_corner) return left;
  return to_above <= to_corner ? above : corner;
}

// Of one row; `step`: bytes a pixel.
template <int (*predict)(int, int, int)>
void Restore(ByteSpan from, const std::uint8_t* above, std::size_t step, std::uint8_t* to) {
  for (std::size_t i = 0; i < step; ++i)
    to[i] = static_cast<std::uint8_t>(from[i] + predict(0, above[i], 0));
  for (std::size_t i = step; i < from.size(); ++i)
    to[i] = static_cast<std::uint8_t>(from[i] + predict(to[i - step], above[i], above[i - step]));
}

// False if there is no such filter.
bool RestoreRow(int filter, ByteSpan from, const std::uint8_t* above, std::size_t step,
                std::uint8_t* to) {
  switch (filter) {
    case 0:
      std::copy(from.begin(), from.end(), to);
      return true;
    case 1:
      Restore<Left>(from, above, step, to);
      return true;
    case 2:
      Restore<Above>(from, above, step, to);
      return true;
    case 3:
      Restore<Average>(from, above, step, to);
      return true;
    case 4:
      Restore<Paeth>(from, above, step, to);
      return true;
    default:
      return false;
  }
}

// `rows`: each its filter's number and its bytes.
std::optional<ImageU8> Restored(const PlainPng& png, ByteSpan rows) {
  ImageU8 image(png.width, png.height, png.channels);
  const std::vector<std::uint8_t> zeros(png.RowBytes());
  const std::uint8_t* above = zeros.data();
  for (int y = 0; y < png.height; ++y) {
    std::uint8_t* const to = image.at(0, y);
    if (!RestoreRow(rows[0], rows.subspan(1, png.RowBytes()), above,
                    static_cast<std::size_t>(png.channels), to)) {
      return std::nullopt;
    }
    above = to;
    rows = rows.subspan(1 + png.RowBytes());
  }
  return image;
}

}  // namespace

std::optional<ImageU8> DecodePlainPng(ByteSpan bytes) {
  const std::optional<PlainPng> png = ReadChunks(bytes);
  if (!png) return std::nullopt;
  const std::size_t size = static_cast<std::size_t>(png->height) * (1 + png->RowBytes());
  const std::unique_ptr<std::uint8_t[]> rows(new (std::nothrow) std::uint8_t[size]);
  if (!rows) return std::nullopt;
  const Bytes joined = png->parts.size() == 1 ? Bytes() : Joined(png->parts);
  const ByteSpan stream = png->parts.size() == 1 ? png->parts[0] : ByteSpan(joined);
  if (!Unpack(stream, {rows.get(), size})) return std::nullopt;
  return Restored(*png, {rows.get(), size});
}

}  // namespace tilegrad::io

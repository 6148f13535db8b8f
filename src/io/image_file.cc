// SPDX-License-Identifier: Apache-2.0
#include "io/image_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/text.h"
#include "io/guarded_process.h"
#include "io/image_readers.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_STDIO
#define STBI_NO_GIF
#define STBI_NO_HDR
#define STBI_NO_PIC
#define STBI_NO_PNM
#define STBI_NO_PSD
// Cleared: missing parts of a broken file become black instead of uninitialised memory.
#define STBI_MALLOC(size) std::calloc(1, size)
#define STBI_REALLOC(block, size) std::realloc(block, size)
#define STBI_FREE(block) std::free(block)
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wshadow"
#include <stb_image.h>
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace tilegrad::io {
namespace {

using ByteSpan = std::span<const std::uint8_t>;

// `count` bytes from `at`, or empty if they are out of range.
ByteSpan Part(ByteSpan bytes, std::size_t at, std::size_t count) {
  return at <= bytes.size() && count <= bytes.size() - at ? bytes.subspan(at, count) : ByteSpan();
}

bool Is(ByteSpan bytes, std::string_view text) {
  return bytes.size() == text.size() && std::equal(bytes.begin(), bytes.end(), text.begin(),
                                                   [](int a, char c) { return a == (c & 0xff); });
}

// The orientation in a TIFF header with its first directory (TIFF 6.0, section 2).
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
  PngChunk chunk;
  for (PngChunks chunks(bytes); chunks.Next(chunk);) {
    if (chunk.type == "eXIf") return OrientationOfTiff(chunk.data);
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

// The largest ratio of pixel bytes to file bytes of any format: deflate reaches 1,032, and a PNG
// with one bit per pixel and a palette unpacks each of those bytes to 8 pixels of 3 bytes: 24,768.
constexpr std::size_t kMaxInflation = 32768;

Result<ImageU8> Decode(std::span<const std::uint8_t> bytes, const std::string& name) {
  const auto length = static_cast<int>(bytes.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), length, &width, &height, &channels)) {
    if (const std::string_view format = UnreadImageFormat(bytes); !format.empty()) {
      return DataLoss("{}: an image in {}, which is not read; save it as PNG or JPEG", name,
                      format);
    }
    return DataLoss("{}: not an image that can be read (PNG, JPEG, WebP, BMP, TGA, PNM, SGI): {}",
                    name, stbi_failure_reason());
  }
  if (height < 0 && height >= -kMaxImageSide) height = -height;  // a BMP stored top row first
  TILEGRAD_TRY(CheckImageSize(width, height, name));
  const std::size_t unpacked = static_cast<std::size_t>(width) * height * channels;
  if (unpacked / kMaxInflation > bytes.size()) {
    return DataLoss("{}: the header says {} x {} pixels, more than {} bytes can hold", name, width,
                    height, bytes.size());
  }
  TILEGRAD_TRY(CheckRawPixels(bytes, width, height, name));
  TILEGRAD_TRY(ReadBudget::Take(unpacked, name));
  if (IsPng(bytes)) {
    if (auto image = DecodePlainPng(bytes)) return std::move(*image);
  }
  const std::unique_ptr<stbi_uc, decltype(&stbi_image_free)> pixels(
      stbi_load_from_memory(bytes.data(), length, &width, &height, &channels, 0), &stbi_image_free);
  if (!pixels && std::string_view(stbi_failure_reason()) == "outofmem") {
    NoteShortage(ENOMEM);
    return IoError("{}: not enough memory for {} x {} pixels", name, width, height);
  }
  if (!pixels) {
    return DataLoss("{}: the header says {} x {} pixels, but the data is truncated or corrupt: {}",
                    name, width, height, stbi_failure_reason());
  }
  ImageU8 image(width, height, channels);
  std::memcpy(image.pixels.data(), pixels.get(), image.pixels.size());
  return image;
}

// As stored.
Result<ImageU8> DecodeBytes(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (bytes.size() > std::size_t{1} << 30)
    return ResourceExhausted("{}: an image file above 1 GiB", name);
  if (IsPnm(bytes)) return DecodePnm(bytes, name);
  if (IsSgi(bytes)) return DecodeSgi(bytes, name);
  TILEGRAD_TRY(CheckImageContainer(bytes, name));  // before stb_image sees the file
  const auto padded = WithFullPalette(bytes);
  return Decode(padded ? std::span<const std::uint8_t>(*padded) : bytes, name);
}

constexpr std::string_view kReadEndings[] = {".png", ".jpg", ".jpeg", ".webp"};
constexpr std::string_view kOtherEndings[] = {".heic", ".heif", ".avif", ".tif", ".tiff", ".bmp",
                                              ".gif",  ".tga",  ".jp2",  ".jxl", ".jfif", ".psd",
                                              ".exr",  ".hdr",  ".ppm",  ".pgm", ".dng",  ".cr2",
                                              ".cr3",  ".nef",  ".arw",  ".raf", ".orf"};

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
  // Whether the stored image is read backwards along its rows and columns.
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

Result<ImageU8> DecodeImage(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (GuardedMustStop()) return Cancelled("{}: stopped", name);
  TILEGRAD_ASSIGN(ImageU8 image, DecodeBytes(bytes, name));
  return Upright(std::move(image), OrientationOf(bytes));
}

Result<StoredImage> LoadStoredImage(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  const auto decode = IsWebp(bytes) ? DecodeWebp : DecodeBytes;
  TILEGRAD_ASSIGN(ImageU8 image, decode(bytes, path.string()));
  return StoredImage{std::move(image), OrientationOf(bytes)};
}

Result<ImageU8> LoadImage(const Path& path) {
  TILEGRAD_ASSIGN(StoredImage stored, LoadStoredImage(path));
  return Upright(std::move(stored.image), stored.orientation);
}

ImageU8 ToColor(ImageU8 image) {
  if (image.channels >= 3) return image;
  const bool alpha = image.channels == 2;
  ImageU8 out(image.width, image.height, alpha ? 4 : 3);
  const std::size_t count = static_cast<std::size_t>(image.width) * image.height;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* from = &image.pixels[i * image.channels];
    std::uint8_t* to = &out.pixels[i * out.channels];
    std::fill_n(to, 3, from[0]);
    if (alpha) to[3] = from[1];
  }
  return out;
}

Result<Bytes> EncodePng(const ImageU8& image) {
  if (image.empty() || image.channels < 1 || image.channels > 4) {
    return InvalidArgument("a PNG needs 1 to 4 channels and a pixel, got {} x {} x {}", image.width,
                           image.height, image.channels);
  }
  Bytes out;
  const auto append = [](void* context, void* data, int size) {
    const auto* begin = static_cast<const std::uint8_t*>(data);
    static_cast<Bytes*>(context)->insert(static_cast<Bytes*>(context)->end(), begin, begin + size);
  };
  if (!stbi_write_png_to_func(append, &out, image.width, image.height, image.channels,
                              image.pixels.data(), image.width * image.channels)) {
    return InternalError("encoding a PNG of {} x {} failed", image.width, image.height);
  }
  return out;
}

Status SavePng(const Path& path, const ImageU8& image) {
  TILEGRAD_ASSIGN(const Bytes bytes, EncodePng(image));
  return WriteFileAtomic(path, bytes);
}

std::string PictureNames::DescribeOthers() const {
  constexpr std::size_t kNamed = 5;
  if (others.empty()) return "";
  std::string names;
  for (std::size_t i = 0; i < std::min(others.size(), kNamed); ++i)
    names += (i == 0 ? "" : ", ") + others[i].string();
  return fmt::format("{} not in PNG, JPEG or WebP: {}{}", Count(others.size(), "picture"), names,
                     others.size() > kNamed ? ", ..." : "");
}

PictureNames PicturesIn(const Path& folder) {
  PictureNames out;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    const bool hidden = at->path().filename().string().starts_with('.');  // such as macOS's ._a.jpg
    if (hidden || !IsFile(at->path())) continue;
    const std::string ending = LowerCase(at->path().extension().string());
    if (std::ranges::find(kReadEndings, ending) != std::end(kReadEndings))
      out.read.push_back(at->path().filename());
    if (std::ranges::find(kOtherEndings, ending) != std::end(kOtherEndings))
      out.others.push_back(at->path().filename());
  }
  std::ranges::sort(out.read);
  std::ranges::sort(out.others);
  return out;
}

}  // namespace tilegrad::io

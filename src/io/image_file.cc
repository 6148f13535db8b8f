// SPDX-License-Identifier: Apache-2.0
#include "io/image_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/shortage.h"
#include "io/guarded_process.h"
#include "io/image_check.h"
#include "io/orientation.h"
#include "io/plain_images.h"
#include "io/webp_reader.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_STDIO
#define STBI_NO_GIF
#define STBI_NO_HDR
#define STBI_NO_PIC
#define STBI_NO_PNM
#define STBI_NO_PSD
// Cleared: what a broken file leaves out is black, not what was in memory before.
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

// No format packs more bytes of pixels into a byte of file: deflate reaches 1,032, and a PNG with
// one bit a pixel and a palette unpacks each of those bytes to 8 pixels of 3 bytes: 24,768.
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
  if (height < 0 && height >= -kMaxImageSide) height = -height;  // a BMP with its first row on top
  TILEGRAD_TRY(CheckImageSize(width, height, name));
  const std::size_t unpacked = static_cast<std::size_t>(width) * height * channels;
  if (unpacked / kMaxInflation > bytes.size()) {
    return DataLoss("{}: the header says {} x {} pixels, more than {} bytes can hold", name, width,
                    height, bytes.size());
  }
  TILEGRAD_TRY(CheckRawPixels(bytes, width, height, name));
  TILEGRAD_TRY(ReadBudget::Take(unpacked, name));
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

Result<ImageU8> DecodeBytes(std::span<const std::uint8_t> bytes, const std::string& name,
                            PixelOrder order) {
  if (bytes.size() > std::size_t{1} << 30)
    return ResourceExhausted("{}: an image file above 1 GiB", name);
  if (IsPnm(bytes)) return DecodePnm(bytes, name);
  if (IsSgi(bytes)) return DecodeSgi(bytes, name);
  TILEGRAD_TRY(CheckImageContainer(bytes, name));  // before stb_image sees anything
  const auto padded = WithFullPalette(bytes);
  TILEGRAD_ASSIGN(ImageU8 image,
                  Decode(padded ? std::span<const std::uint8_t>(*padded) : bytes, name));
  return order == PixelOrder::kStored ? std::move(image)
                                      : Upright(std::move(image), OrientationOf(bytes));
}

}  // namespace

Result<ImageU8> DecodeImage(std::span<const std::uint8_t> bytes, const std::string& name,
                            PixelOrder order) {
  if (GuardedMustStop()) return Cancelled("{}: stopped", name);
  return DecodeBytes(bytes, name, order);
}

Result<StoredImage> LoadStoredImage(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  TILEGRAD_ASSIGN(ImageU8 image, IsWebp(bytes)
                                     ? DecodeWebp(bytes, path.string())
                                     : DecodeBytes(bytes, path.string(), PixelOrder::kStored));
  return StoredImage{std::move(image), OrientationOf(bytes)};
}

Result<ImageU8> LoadImage(const Path& path, PixelOrder order) {
  TILEGRAD_ASSIGN(StoredImage stored, LoadStoredImage(path));
  return order == PixelOrder::kStored ? std::move(stored.image)
                                      : Upright(std::move(stored.image), stored.orientation);
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

}  // namespace tilegrad::io

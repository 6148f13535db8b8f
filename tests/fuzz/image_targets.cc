// SPDX-License-Identifier: Apache-2.0
// Readers of images. One decoder takes them all; the targets differ in where they begin, and in
// what is mended: a PNG with a wrong checksum is refused before anything else is looked at.
#include <webp/encode.h>
#include <zlib.h>

#include <cmath>

#include "base/read_budget.h"
#include "fuzz/target.h"
#include "io/exr_file.h"
#include "io/image_file.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace tilegrad::fuzz::image_targets {

constexpr std::size_t kBudget = std::size_t{16} << 20;

void Check(const Result<ImageU8>& image) {
  if (!image.ok()) return Require(!image.status().message().empty(), "an error has a message");
  Require(image->width >= 1 && image->width <= io::kMaxImageSide, "a width within the limit");
  Require(image->height >= 1 && image->height <= io::kMaxImageSide, "a height within the limit");
  Require(image->channels >= 1 && image->channels <= 4, "1 to 4 channels");
  const std::size_t pixels = static_cast<std::size_t>(image->width) * image->height;
  Require(image->pixels.size() == pixels * image->channels, "all pixels are there");
  const ImageU8 color = io::ToColor(*image);
  Require(color.pixels.size() == pixels * color.channels && color.channels >= 3, "colours");
}

// The same bytes give the same picture: nothing comes from memory that was never written.
void Decode(Input input) {
  const ReadBudget budget(kBudget);
  const auto first = io::DecodeImage(input, "image");
  Check(first);
  const auto again = io::DecodeImage(input, "image");
  Require(first.ok() == again.ok(), "the same outcome again");
  if (first.ok()) Require(first->pixels == again->pixels, "the same pixels again");
  if (first.ok() && input.size() < 4096) {
    const auto png = io::EncodePng(*first);
    Require(png.ok(), "what was read can be written");
    const auto back = io::DecodeImage(*png, "again");
    Require(back.ok() && back->pixels == first->pixels, "what was written comes back");
  }
}

ImageU8 Picture(int width, int height, int channels) {
  ImageU8 image(width, height, channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = static_cast<std::uint8_t>(i * i / 3);
  }
  return image;
}

void Append(void* out, void* data, int size) {
  const auto* begin = static_cast<const std::uint8_t*>(data);
  static_cast<Bytes*>(out)->insert(static_cast<Bytes*>(out)->end(), begin, begin + size);
}

template <class Write>
Bytes ByStb(const ImageU8& image, Write write) {
  Bytes out;
  write(Append, &out, image.width, image.height, image.channels, image.pixels.data());
  return out;
}

Bytes Jpeg(const ImageU8& image, int quality) {
  return ByStb(image,
               [quality](auto... arguments) { stbi_write_jpg_to_func(arguments..., quality); });
}

std::vector<Bytes> PngSeeds() {
  std::vector<Bytes> out;
  for (int channels = 1; channels <= 4; ++channels) {
    out.push_back(*io::EncodePng(Picture(5, 3, channels)));
  }
  // A palette, with a tag of orientation: IHDR, PLTE, eXIf, IDAT, IEND; checksums are mended.
  const std::string pixels("\x78\x9c\x63\x10\x00\x00\x00\x13\x00\x12", 10);  // 0 16 as 4-bit rows
  std::string png("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\2\0\0\0\1\4\3\0\0\0....", 33);
  png.append("\0\0\0\6PLTE\1\2\3\4\5\6....", 18);
  png.append(
      "\0\0\0\x1a"
      "eXIfII*\0\x08\0\0\0\1\0\x12\1\3\0\1\0\0\0\6\0\0\0\0\0\0\0....",
      38);
  png.append("\0\0\0\x0aIDAT", 8).append(pixels).append("....");
  png.append("\0\0\0\0IEND....", 12);
  out.push_back(ToBytes(png));
  return out;
}

std::uint32_t Big32(std::span<const std::uint8_t> b) {
  return static_cast<std::uint32_t>(b[0]) << 24 | static_cast<std::uint32_t>(b[1]) << 16 |
         static_cast<std::uint32_t>(b[2]) << 8 | b[3];
}

// Writes the checksum of every chunk that lies in the file.
void RepairPng(std::span<std::uint8_t> bytes) {
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    const std::size_t length = Big32(bytes.subspan(at));
    if (length > bytes.size() - at - 12) return;
    const auto crc = crc32_z(0, &bytes[at + 4], length + 4);
    for (std::size_t k = 0; k < 4; ++k) {
      bytes[at + 8 + length + k] = static_cast<std::uint8_t>(crc >> (24 - 8 * k));
    }
    at += length + 12;
  }
}

std::vector<Bytes> RepairedPngSeeds() {
  std::vector<Bytes> out = PngSeeds();
  for (Bytes& seed : out) RepairPng(seed);
  return out;
}

std::vector<Bytes> JpegSeeds() {
  Bytes tagged = Jpeg(Picture(9, 9, 3), 50);
  const std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0II*\0\x08\0\0\0\1\0\x12\1\3\0\1\0\0\0\6\0\0\0\0\0\0\0",
      36);
  tagged.insert(tagged.begin() + 2, exif.begin(), exif.end());
  return {Jpeg(Picture(16, 8, 3), 90), Jpeg(Picture(8, 8, 1), 20), tagged};
}

std::vector<Bytes> RawSeeds() {
  std::vector<Bytes> out;
  for (int channels = 1; channels <= 4; ++channels) {
    const ImageU8 image = Picture(4, 3, channels);
    out.push_back(ByStb(image, [](auto... a) { stbi_write_tga_to_func(a...); }));
    out.push_back(ByStb(image, [](auto... a) { stbi_write_bmp_to_func(a...); }));
  }
  return out;
}

std::vector<Bytes> PnmSeeds() {
  return {ToBytes("P6 2 1 255\nabcdef"), ToBytes("P5\n# c\n2 2 9\nabcd"),
          ToBytes("P5 1 2 65535\nabcd")};
}

std::vector<Bytes> SgiSeeds() {
  const auto header = [](char encoded, char sample_bytes, char channels) {
    std::string out("\x01\xda", 2);
    out += encoded;
    out += sample_bytes;
    out.append("\0\3\0\2\0\1\0", 7) += channels;
    out.resize(512, '\0');
    return out;
  };
  std::string runs = header(1, 1, 1);  // two rows that share one run: begins, lengths, data
  runs.append("\0\0\2\x10\0\0\2\x10\0\0\0\6\0\0\0\6", 16).append("\2ab\x81z\0", 6);
  return {ToBytes(header(0, 1, 1) + "abcdef"), ToBytes(header(0, 2, 1) + "abcdefghijkl"),
          ToBytes(header(0, 1, 4) + "abcdefghijklmnopqrstuvwx"), ToBytes(runs)};
}

void CheckExr(const Result<io::LoadedExr>& exr) {
  if (!exr.ok()) return Require(!exr.status().message().empty(), "an error has a message");
  const std::size_t pixels = static_cast<std::size_t>(exr->width) * exr->height;
  Require(exr->values.size() == pixels * exr->names.size(), "all values are there");
  Require(pixels > 0 && !exr->names.empty(), "there is a pixel and a channel");
}

// In a process of its own for each file.
void Exr(Input input) {
  const ReadBudget budget(kBudget);
  CheckExr(io::DecodeExr(input, "image"));
}

// What such a process leaves behind.
void ExrFromReader(Input input) {
  const ReadBudget budget(kBudget);
  CheckExr(io::ExrFromReader(input));
}

std::vector<Bytes> ExrFromReaderSeeds() {
  Bytes image = {'I', 2, 0, 0, 0,   1, 0,   0,   0,   2, 0,   0, 0,
                 1,   0, 0, 0, 'A', 0, 'n', '.', 'X', 0, 'w', 0};
  image.resize(image.size() + 2 * 1 * 2 * sizeof(float));
  return {image, ToBytes("Ethe file is cut short")};
}

std::vector<Bytes> ExrSeeds() {
  std::vector<float> values(6, 0.5f);
  values[2] = INFINITY;
  return {*io::EncodeExr({3, 2, {{"R", values}, {"A", values}, {"normal.X", values}}}),
          *io::EncodeExr({1, 6, {{"Z", values}}})};
}

// Read from files alone.
void Webp(Input input) {
  const ReadBudget budget(kBudget);
  const MemoryFile file(input);
  Check(io::LoadImage(file.path()));
}

std::vector<Bytes> WebpSeeds() {
  std::vector<Bytes> out;
  for (const float quality : {-1.0f, 80.0f}) {  // -1: lossless
    const ImageU8 image = Picture(20, 11, 4);
    std::uint8_t* bytes = nullptr;
    const std::size_t size = quality < 0
                                 ? WebPEncodeLosslessRGBA(image.pixels.data(), 20, 11, 80, &bytes)
                                 : WebPEncodeRGBA(image.pixels.data(), 20, 11, 80, quality, &bytes);
    out.emplace_back(bytes, bytes + size);
    WebPFree(bytes);
  }
  return out;
}

const Registration kTargets[] = {
    Registration({"png", Decode, RepairedPngSeeds, RepairPng}),
    Registration({"jpeg", Decode, JpegSeeds}),
    Registration({"webp", Webp, WebpSeeds}),
    Registration({"bmp_tga", Decode, RawSeeds}),
    Registration({"pnm", Decode, PnmSeeds}),
    Registration({"sgi", Decode, SgiSeeds}),
    Registration({"exr", Exr, ExrSeeds, nullptr, 2}),
    Registration({"exr_from_reader", ExrFromReader, ExrFromReaderSeeds}),
};

}  // namespace tilegrad::fuzz::image_targets

// SPDX-License-Identifier: Apache-2.0
// Readers of images. One decoder takes them all; the targets differ in where they begin, and in
// what is mended: a PNG with a wrong checksum is refused before anything else is looked at.
#include <zlib.h>

#include "base/error.h"
#include "fuzz/target.h"
#include "io/exr_file.h"
#include "io/image_file.h"

namespace tilegrad::fuzz::image_targets {

constexpr std::size_t kBudget = std::size_t{16} << 20;

void Check(const Result<ImageU8>& image) {
  if (!Accepted(image)) return;
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

void CheckExr(const Result<io::LoadedExr>& exr) {
  if (!Accepted(exr)) return;
  const std::size_t pixels = static_cast<std::size_t>(exr->width) * exr->height;
  Require(exr->values.size() == pixels * exr->names.size(), "all values are there");
  Require(pixels > 0 && !exr->names.empty(), "there is a pixel and a channel");
}

// In a process of its own for each file.
void Exr(Input input) { CheckExr(io::DecodeExr(input, "image")); }

// What such a process leaves behind.
void ExrFromReader(Input input) { CheckExr(io::ExrFromReader(input)); }

std::vector<Bytes> ExrFromReaderSeeds() {
  return {io::ExrForReader(io::LoadedExr{2, 1, {"A", "n.X"}, {0, 0, 0, 0}, {"w"}}),
          io::ExrForReader(DataLoss("the file is cut short"))};
}

// Read from files alone.
void Webp(Input input) {
  const MemoryFile file(input);
  Check(io::LoadImage(file.path()));
}

const Registration kTargets[] = {
    Registration({.name = "png", .run = Decode, .repair = RepairPng, .read_budget = kBudget}),
    Registration({.name = "jpeg", .run = Decode, .read_budget = kBudget}),
    Registration({.name = "webp", .run = Webp, .read_budget = kBudget}),
    Registration({.name = "bmp_tga", .run = Decode, .read_budget = kBudget}),
    Registration({.name = "pnm", .run = Decode, .read_budget = kBudget}),
    Registration({.name = "sgi", .run = Decode, .read_budget = kBudget}),
    Registration({.name = "exr", .run = Exr, .mutations = 2, .read_budget = kBudget}),
    Registration({.name = "exr_from_reader",
                  .run = ExrFromReader,
                  .seeds = ExrFromReaderSeeds,
                  .read_budget = kBudget}),
};

}  // namespace tilegrad::fuzz::image_targets

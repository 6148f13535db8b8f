// SPDX-License-Identifier: Apache-2.0
// PNG files of all kinds: what libdeflate and what stb_image decodes.
#include <gtest/gtest.h>
#include <zlib.h>

#include <memory>

#include "base/rng.h"
#include "io/image_file.h"
#include "io/image_readers.h"
#include "support/expect.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wshadow"
#include <stb_image.h>
#pragma GCC diagnostic pop

namespace tilegrad::io::png_test {

void AppendNumber(std::uint64_t value, Bytes* to) {
  for (int i = 0; i < 4; ++i) to->push_back(static_cast<std::uint8_t>(value >> (24 - 8 * i)));
}

void AppendChunk(const std::string& type, const Bytes& data, Bytes* png) {
  AppendNumber(data.size(), png);
  const std::size_t at = png->size();
  png->insert(png->end(), type.begin(), type.end());
  png->insert(png->end(), data.begin(), data.end());
  AppendNumber(crc32(0, &(*png)[at], static_cast<uInt>(png->size() - at)), png);
}

Bytes Packed(const Bytes& rows) {
  uLongf size = compressBound(rows.size());
  Bytes packed(size);
  EXPECT_EQ(compress(packed.data(), &size, rows.data(), rows.size()), Z_OK);
  packed.resize(size);
  return packed;
}

struct Kind {
  int width, height, color_type;
  int bits = 8, interlaced = 0;

  std::size_t RowBytes() const {
    constexpr std::size_t kChannels[] = {1, 0, 3, 1, 2, 0, 4};
    return static_cast<std::size_t>(width * bits / 8) * kChannels[color_type];
  }
  Bytes Header() const {
    Bytes out;
    AppendNumber(static_cast<std::uint64_t>(width), &out);
    AppendNumber(static_cast<std::uint64_t>(height), &out);
    for (const int byte : {bits, color_type, 0, 0, interlaced})
      out.push_back(static_cast<std::uint8_t>(byte));
    return out;
  }
  // Any bytes are a picture: each row has its filter's number, from 0 to 4, and noise.
  Bytes Rows() const {
    Rng rng(7, static_cast<std::uint64_t>(width + 100 * color_type));
    Bytes out;
    for (int y = 0; y < height; ++y) {
      out.push_back(static_cast<std::uint8_t>(y % 5));
      for (std::size_t i = 0; i < RowBytes(); ++i)
        out.push_back(static_cast<std::uint8_t>(rng.Below(256)));
    }
    return out;
  }
};

using Chunks = std::vector<std::pair<std::string, Bytes>>;

// The chunks between header and end.
Bytes PngOf(const Kind& kind, const Chunks& chunks) {
  Bytes png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  AppendChunk("IHDR", kind.Header(), &png);
  for (const auto& [type, data] : chunks) AppendChunk(type, data, &png);
  AppendChunk("IEND", {}, &png);
  return png;
}

void ExpectAsStb(const Bytes& png) {
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, decltype(&stbi_image_free)> pixels(
      stbi_load_from_memory(png.data(), static_cast<int>(png.size()), &width, &height, &channels,
                            0),
      &stbi_image_free);
  ASSERT_NE(pixels, nullptr) << stbi_failure_reason();
  const auto image = Ok(DecodeImage(png, "a.png"));
  EXPECT_EQ(image->width, width);
  EXPECT_EQ(image->height, height);
  ASSERT_EQ(image->channels, channels);
  EXPECT_TRUE(std::equal(image->pixels.begin(), image->pixels.end(), pixels.get()));
}

constexpr Kind kSmall = {5, 7, 2};

TEST(Png, PlainOnesAreAsStbReadsThem) {
  for (const int type : {0, 2, 4, 6}) {
    for (const int width : {1, 2, 33}) {
      const Kind kind{width, 23, type};
      const Bytes packed = Packed(kind.Rows());
      const auto third = packed.begin() + std::ssize(packed) / 3;
      const Bytes whole = PngOf(kind, {{"IDAT", packed}}),
                  parts = PngOf(kind, {{"gAMA", {0, 0, 0, 1}},
                                       {"IDAT", {packed.begin(), third}},
                                       {"IDAT", {}},
                                       {"IDAT", {third, packed.end()}}});
      EXPECT_TRUE(DecodePlainPng(whole));
      EXPECT_TRUE(DecodePlainPng(parts));
      ExpectAsStb(whole);
      ExpectAsStb(parts);
    }
  }
}

TEST(Png, OthersAreStbs) {
  const Kind deep{5, 7, 2, 16}, turns{1, 1, 2, 8, 1}, palette{5, 1, 3};
  const Bytes key = {0, 1, 0, 2, 0, 3};
  const Bytes packed = Packed(kSmall.Rows());
  for (const Bytes& png :
       {PngOf(deep, {{"IDAT", Packed(deep.Rows())}}),
        PngOf(turns, {{"IDAT", Packed(turns.Rows())}}),
        PngOf(palette, {{"PLTE", Bytes(768, 9)}, {"IDAT", Packed(palette.Rows())}}),
        PngOf(kSmall, {{"tRNS", key}, {"IDAT", packed}}),
        PngOf(kSmall, {{"PLTE", Bytes(768, 9)}, {"IDAT", packed}})}) {
    EXPECT_FALSE(DecodePlainPng(png));
    ExpectAsStb(png);
  }
}

// A wrong checksum of the pixels, and more of them than there should be.
TEST(Png, WhatStbToleratesIsRead) {
  Bytes wrong = Packed(kSmall.Rows()), rows = kSmall.Rows();
  wrong.back() ^= 1;
  rows.resize(rows.size() + 100);
  for (const Bytes& packed : {wrong, Packed(rows)}) {
    const Bytes png = PngOf(kSmall, {{"IDAT", packed}});
    EXPECT_FALSE(DecodePlainPng(png));
    ExpectAsStb(png);
  }
}

TEST(Png, DamagedPixelsAreErrors) {
  Bytes filter = kSmall.Rows(), few = kSmall.Rows(), packed = Packed(kSmall.Rows());
  filter[0] = 5;
  few.pop_back();
  packed.resize(packed.size() / 2);
  for (const Bytes& damaged : {Packed(filter), Packed(few), packed, Bytes(40, 0x55), Bytes()}) {
    const Bytes png = PngOf(kSmall, {{"IDAT", damaged}});
    EXPECT_FALSE(DecodePlainPng(png));
    ExpectMessage(DecodeImage(png, "a.png").status(), "a.png", "5 x 7", "truncated or corrupt");
  }
  for (const Chunks& chunks : {Chunks{}, Chunks{{"ABCD", {}}, {"IDAT", Packed(kSmall.Rows())}}})
    EXPECT_FALSE(DecodeImage(PngOf(kSmall, chunks), "a.png").ok());
}

// Colour 200 of a palette of two was whatever was in memory.
TEST(Png, ColoursBeyondThePaletteAreBlack) {
  const Bytes row = {0, 1, 200, 0};  // no filter, three pixels
  const auto image = Ok(DecodeImage(
      PngOf({3, 1, 3}, {{"PLTE", {1, 2, 3, 4, 5, 6}}, {"IDAT", Packed(row)}}), "a.png"));
  EXPECT_EQ(image->pixels, (std::vector<std::uint8_t>{4, 5, 6, 0, 0, 0, 1, 2, 3}));
}

Bytes ToBytes(const std::string& text) { return {text.begin(), text.end()}; }

// Two columns, two rows; `rows` begin with their filter, which is none.
Bytes SmallPng(int bits, int color_type, const std::string& rows, Chunks chunks = {},
               int interlaced = 0) {
  chunks.emplace_back("IDAT", Packed(ToBytes(rows)));
  return PngOf({2, 2, color_type, bits, interlaced}, chunks);
}

// Red, green / blue, white in every way; greys are black, middle / white, quarter.
TEST(Png, OfEveryKind) {
  using namespace std::string_literals;
  using Pixels = std::vector<std::uint8_t>;
  const std::string r = "\xff\0\0"s, g = "\0\xff\0"s, b = "\0\0\xff"s, w = "\xff\xff\xff"s,
                    zero = "\0"s;
  const std::pair<std::string, Bytes> palette("PLTE", ToBytes(r + g + b + w));
  const auto doubled = [](const std::string& text) {
    std::string out;
    for (const char c : text) out += {c, c};
    return out;
  };
  const Pixels colors = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  const Pixels with_alpha = {255, 0, 0, 128, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255};
  const Pixels keyed = {255, 0, 0, 0, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255};
  struct Case {
    const char* what;
    Bytes png;
    Pixels want;
  };
  const std::string rows = zero + r + g + zero + b + w;
  for (const Case& c : std::vector<Case>{
           {"RGB", SmallPng(8, 2, rows), colors},
           {"16 bits", SmallPng(16, 2, zero + doubled(r + g) + zero + doubled(b + w)), colors},
           {"palette", SmallPng(8, 3, "\0\0\1\0\2\3"s, {palette}), colors},
           {"palette of 2 bits", SmallPng(2, 3, "\0\x10\0\xb0"s, {palette}), colors},
           {"palette with alpha", SmallPng(8, 3, "\0\0\1\0\2\3"s, {palette, {"tRNS", {0x80}}}),
            with_alpha},
           {"transparent red", SmallPng(8, 2, rows, {{"tRNS", {0, 255, 0, 0, 0, 0}}}), keyed},
           {"interlaced", SmallPng(8, 2, zero + r + zero + g + zero + b + w, {}, 1), colors},
           {"grey", SmallPng(8, 0, "\0\0\x80\0\xff\x40"s), {0, 128, 255, 64}},
           {"grey of 1 bit", SmallPng(1, 0, "\0\x80\0\x40"s), {255, 0, 0, 255}},
           {"grey of 2 bits", SmallPng(2, 0, "\0\x10\0\xb0"s), {0, 85, 170, 255}},
           {"grey of 4 bits", SmallPng(4, 0, "\0\x0f\0\x88"s), {0, 255, 136, 136}},
           {"grey of 16 bits", SmallPng(16, 0, "\0\0\0\x80\0\0\xff\xff\x40\0"s), {0, 128, 255, 64}},
           {"grey and alpha",
            SmallPng(8, 4, "\0\x80\xff\x80\x80\0\xff\0\x40\xff"s),
            {128, 255, 128, 128, 255, 0, 64, 255}}}) {
    const auto image = DecodeImage(c.png, "a.png");
    ASSERT_TRUE(image.ok()) << c.what << ": " << image.status().message();
    EXPECT_EQ(image->pixels, c.want) << c.what;
  }
}

// PNG's own words on what its numbers mean are not followed: glTF says so, and others do the same.
TEST(Png, ProfilesAndGammaDoNotChangeNumbers) {
  using namespace std::string_literals;
  const std::string rows = "\0\x40\x80\0\xc0\xff"s;
  const auto plain = DecodeImage(SmallPng(8, 0, rows), "a.png");
  const auto tagged =
      Ok(DecodeImage(SmallPng(8, 0, rows, {{"gAMA", {0, 1, 0x86, 0xa0}}, {"sRGB", {0}}}), "a.png"));
  EXPECT_EQ(tagged->pixels, plain.value().pixels);
  EXPECT_EQ(tagged->pixels, (std::vector<std::uint8_t>{64, 128, 192, 255}));
}

TEST(Png, OfXcodeIsRefused) {
  Bytes png = SmallPng(8, 0, std::string(6, '\0'));
  Bytes mark;
  AppendChunk("CgBI", {0x50, 0x20, 0x20, 2}, &mark);
  png.insert(png.begin() + 8, mark.begin(), mark.end());
  ExpectMessage(DecodeImage(png, "a.png").status(), "a.png", "Xcode");
}

}  // namespace tilegrad::io::png_test

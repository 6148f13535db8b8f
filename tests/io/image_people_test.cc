// SPDX-License-Identifier: Apache-2.0
// Images as cameras and print shops write them: turned, and of four inks.
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>

#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::image_people_test {

std::string Big(std::uint32_t value, int bytes) {
  std::string out;
  for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(value >> (8 * i));
  return out;
}

std::string Little(std::uint32_t value, int bytes) {
  const std::string big = Big(value, bytes);
  return {big.rbegin(), big.rend()};
}

// A TIFF header with two tags, the second of which is the orientation.
std::string Tiff(bool big, int orientation) {
  const auto n = [big](std::uint32_t v, int bytes) {
    return big ? Big(v, bytes) : Little(v, bytes);
  };
  const auto entry = [&](std::uint32_t tag, std::uint32_t value) {
    return n(tag, 2) + n(3, 2) + n(1, 4) + n(value, 2) + n(0, 2);
  };
  return (big ? "MM" : "II") + n(42, 2) + n(8, 4) + n(2, 2) + entry(256, 3) +
         entry(274, static_cast<std::uint32_t>(orientation)) + n(0, 4);
}

Bytes ToBytes(const std::string& text) { return {text.begin(), text.end()}; }

// Three columns, two rows: abc / def.
Bytes LetterPng(const std::string& exif) {
  ImageU8 image(3, 2, 1);
  for (int i = 0; i < 6; ++i) image.pixels[i] = static_cast<std::uint8_t>('a' + i);
  const Bytes png = EncodePng(image).value();
  std::string text(png.begin(), png.end());
  if (exif.empty()) return png;
  const std::string chunk = "eXIf" + exif;
  const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(chunk.data()), chunk.size());
  text.insert(33, Big(static_cast<std::uint32_t>(exif.size()), 4) + chunk +
                      Big(static_cast<std::uint32_t>(crc), 4));  // behind the header
  return ToBytes(text);
}

std::string LettersOf(const ImageU8& image) {
  std::string out;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) out += static_cast<char>(image.at(x, y)[0]);
    out += y + 1 < image.height ? "/" : "";
  }
  return out;
}

std::string Letters(const Bytes& png) {
  const auto image = DecodeImage(png, "a.png");
  return image.ok() ? LettersOf(*image) : image.status().message();
}

class Orientation : public TempFolderTest {};

// As Exif 2.32 says where row 0 and column 0 of the stored image are to be seen.
TEST_F(Orientation, AllEight) {
  const std::array<const char*, 9> expected = {"",         "abc/def",  "cba/fed",
                                               "fed/cba",  "def/abc",  "ad/be/cf",
                                               "da/eb/fc", "fc/eb/da", "cf/be/ad"};
  for (int o = 1; o <= 8; ++o) {
    for (const bool big : {false, true}) {
      EXPECT_EQ(Letters(LetterPng(Tiff(big, o))), expected[o]) << o;
      const auto stored = Ok(LoadStoredImage(Write("a.png", LetterPng(Tiff(big, o)))));
      EXPECT_EQ(LettersOf(stored->image), "abc/def");
      EXPECT_EQ(stored->orientation, o);
    }
  }
}

TEST_F(Orientation, NonsenseIsUpright) {
  const std::string good = Tiff(true, 6);
  EXPECT_EQ(Letters(LetterPng("")), "abc/def");
  EXPECT_EQ(Letters(LetterPng(Tiff(true, 0))), "abc/def");
  EXPECT_EQ(Letters(LetterPng(Tiff(true, 9))), "abc/def");
  EXPECT_EQ(Letters(LetterPng("XX" + good.substr(2))), "abc/def");
  EXPECT_EQ(Letters(LetterPng("MM" + Big(42, 2) + Big(0xfffffff0, 4) + good.substr(8))), "abc/def");
  for (std::size_t n = 0; n < good.size() - 6; ++n)  // before the end of the second tag
    EXPECT_EQ(Letters(LetterPng(good.substr(0, n))), "abc/def") << n;
}

// A baseline JPEG of 8 x 8 pixels of one colour: quantisation by 1, of each component only the
// mean.
class FlatJpeg {
 public:
  explicit FlatJpeg(std::vector<int> components) : components_(std::move(components)) {}

  std::string Segment(int marker, const std::string& content) const {
    return std::string("\xff") + static_cast<char>(marker) +
           Big(static_cast<std::uint32_t>(content.size() + 2), 2) + content;
  }
  // `extra`: segments behind the start.
  Bytes Make(const std::string& extra, int width = 8) {
    const auto count = static_cast<std::uint32_t>(components_.size());
    std::string frame = Big(8, 1) + Big(8, 2) + Big(static_cast<std::uint32_t>(width), 2),
                scan = Big(count, 1);
    frame += Big(count, 1);
    for (std::uint32_t c = 1; c <= count; ++c) {
      frame += Big(c, 1) + "\x11" + Big(0, 1);
      scan += Big(c, 1) + Big(0, 1);
    }
    // Means: twelve codes of 4 bits, for 0 to 11 bits. The rest: one code of one bit, "no more".
    std::string means = Big(0, 1) + Big(0, 3) + Big(12, 1) + std::string(12, '\0');
    for (int i = 0; i < 12; ++i) means += static_cast<char>(i);
    const std::string rest = "\x10" + Big(1, 1) + std::string(15, '\0') + Big(0, 1);
    for (int block = 0; block < width / 8; ++block) {
      for (const int value : components_) Mean(block == 0 ? 8 * (value - 128) : 0);
    }
    return ToBytes("\xff\xd8" + extra + Segment(0xdb, Big(0, 1) + std::string(64, '\x01')) +
                   Segment(0xc0, frame) + Segment(0xc4, means) + Segment(0xc4, rest) +
                   Segment(0xda, scan + Big(0, 1) + "\x3f" + Big(0, 1)) + Bits() + "\xff\xd9");
  }

 private:
  void Mean(int value) {
    int bits = 0;
    while (std::abs(value) >> bits) ++bits;
    Put(bits, 4);
    Put(value < 0 ? value + (1 << bits) - 1 : value, bits);
    Put(0, 1);
  }
  void Put(int value, int count) {
    for (int i = count - 1; i >= 0; --i) bits_ += value >> i & 1 ? '1' : '0';
  }
  std::string Bits() const {
    std::string out, bits = bits_;
    while (bits.size() % 8 != 0) bits += '1';
    for (std::size_t i = 0; i < bits.size(); i += 8) {
      out += static_cast<char>(std::stoi(bits.substr(i, 8), nullptr, 2));
      if (out.back() == '\xff') out += '\0';
    }
    return out;
  }

  std::vector<int> components_;
  std::string bits_;
};

std::string Adobe(int transform) {
  return "\xff\xee" + Big(14, 2) + "Adobe" + Big(100, 2) + Big(0, 4) + Big(transform, 1);
}

void ExpectColor(const Result<ImageU8>& image, std::array<int, 3> color) {
  ASSERT_TRUE(image.ok()) << image.status().message();
  ASSERT_EQ(image->channels, 3);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(image->at(3, 3)[c], color[c], 1) << c;
}

TEST(Jpeg, TurnedByItsExifSegment) {
  const std::string exif = "\xff\xe1" + Big(46, 2) + std::string("Exif\0\0", 6) + Tiff(false, 6);
  const std::string xmp = "\xff\xe1" + Big(10, 2) + "http:xmp";
  ASSERT_EQ(Tiff(false, 6).size(), 38u);
  for (const std::string& extra : {exif, xmp + exif}) {
    const Bytes jpeg = FlatJpeg({200}).Make(extra, 16);
    const auto image = Ok(DecodeImage(jpeg, "a.jpg"));
    EXPECT_EQ(image->width, 8);
    EXPECT_EQ(image->height, 16);
    EXPECT_EQ(OrientationOf(jpeg), 6);
  }
  EXPECT_EQ(DecodeImage(FlatJpeg({200}).Make(xmp, 16), "a.jpg").value().width, 16);
}

// Adobe stores inks inverted: 255 is none. R = C' K' / 255.
TEST(Jpeg, OfFourInks) {
  ExpectColor(DecodeImage(FlatJpeg({255, 100, 50, 200}).Make(Adobe(0)), "a.jpg"), {200, 78, 39});
  // YCCK: Y 100, no colour, is 100 of each ink's complement; as stb_image has it, inverted.
  const auto ycck = DecodeImage(FlatJpeg({100, 128, 128, 255}).Make(Adobe(2)), "a.jpg");
  ExpectColor(ycck, {155, 155, 155});
}

TEST(Jpeg, OfFourInksThatDoesNotSayHow) {
  for (const std::string& extra :
       {std::string(), Adobe(1), "\xff\xee" + Big(8, 2) + std::string("Other!")}) {
    ExpectMessage(DecodeImage(FlatJpeg({255, 100, 50, 200}).Make(extra), "a.jpg").status(), "a.jpg",
                  "four components", "RGB");
  }
}

TEST(Jpeg, OfThreeComponentsIsYCbCrUnlessAdobeSaysRgb) {
  ExpectColor(DecodeImage(FlatJpeg({76, 85, 255}).Make(""), "a.jpg"), {254, 0, 0});
  ExpectColor(DecodeImage(FlatJpeg({76, 85, 255}).Make(Adobe(0)), "a.jpg"), {76, 85, 255});
}

std::string PngChunk(const std::string& type, const std::string& body) {
  const std::string both = type + body;
  const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(both.data()), both.size());
  return Big(static_cast<std::uint32_t>(body.size()), 4) + both +
         Big(static_cast<std::uint32_t>(crc), 4);
}

// Two columns, two rows of one kind of PNG; `rows` begin with their filter, which is none.
Bytes SmallPng(int depth, int color_type, const std::string& rows, const std::string& chunks = "",
               bool interlaced = false) {
  Bytes packed(compressBound(rows.size()));
  uLongf size = packed.size();
  compress(packed.data(), &size, reinterpret_cast<const Bytef*>(rows.data()), rows.size());
  const std::string header = Big(2, 4) + Big(2, 4) + static_cast<char>(depth) +
                             static_cast<char>(color_type) + std::string(2, '\0') +
                             static_cast<char>(interlaced);
  return ToBytes("\x89PNG\r\n\x1a\n" + PngChunk("IHDR", header) + chunks +
                 PngChunk("IDAT", {packed.begin(), packed.begin() + static_cast<long>(size)}) +
                 PngChunk("IEND", ""));
}

// Red, green / blue, white in every way; greys are black, middle / white, quarter.
TEST(Png, OfEveryKind) {
  using namespace std::string_literals;
  using Pixels = std::vector<std::uint8_t>;
  const std::string r = "\xff\0\0"s, g = "\0\xff\0"s, b = "\0\0\xff"s, w = "\xff\xff\xff"s,
                    zero = "\0"s, palette = PngChunk("PLTE", r + g + b + w);
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
           {"palette", SmallPng(8, 3, "\0\0\1\0\2\3"s, palette), colors},
           {"palette of 2 bits", SmallPng(2, 3, "\0\x10\0\xb0"s, palette), colors},
           {"palette with alpha",
            SmallPng(8, 3, "\0\0\1\0\2\3"s, palette + PngChunk("tRNS", "\x80")), with_alpha},
           {"transparent red",
            SmallPng(8, 2, rows, PngChunk("tRNS", Big(255, 2) + Big(0, 2) + Big(0, 2))), keyed},
           {"interlaced", SmallPng(8, 2, zero + r + zero + g + zero + b + w, "", true), colors},
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
  const auto tagged = Ok(DecodeImage(
      SmallPng(8, 0, rows, PngChunk("gAMA", Big(100000, 4)) + PngChunk("sRGB", "\0"s)), "a.png"));
  EXPECT_EQ(tagged->pixels, plain.value().pixels);
  EXPECT_EQ(tagged->pixels, (std::vector<std::uint8_t>{64, 128, 192, 255}));
}

TEST(Png, OfXcodeIsRefused) {
  Bytes png = SmallPng(8, 0, std::string(6, '\0'));
  const std::string mark = PngChunk("CgBI", "\x50\x20\x20\x02");
  png.insert(png.begin() + 8, mark.begin(), mark.end());
  ExpectMessage(DecodeImage(png, "a.png").status(), "a.png", "Xcode");
}

TEST(Image, GreyBecomesColor) {
  ImageU8 grey(1, 1, 2);
  grey.pixels = {70, 90};
  EXPECT_EQ(ToColor(grey).pixels, (std::vector<std::uint8_t>{70, 70, 70, 90}));
  grey.channels = 1;
  grey.pixels = {70};
  EXPECT_EQ(ToColor(grey).pixels, (std::vector<std::uint8_t>{70, 70, 70}));
}

}  // namespace tilegrad::io::image_people_test

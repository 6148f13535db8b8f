// SPDX-License-Identifier: Apache-2.0
// Images as cameras and print shops write them: turned, and of four inks.
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>

#include "io/image_file.h"
#include "io/samples.h"
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

// Of 8 x 8 pixels with these components, "200": of 16 x 8, the left half; `extra`: segments behind
// the start.
Bytes FlatJpeg(const std::string& components, const std::string& extra) {
  Bytes bytes = StoredSample("flat_" + components + ".jpg");
  bytes.insert(bytes.begin() + 2, extra.begin(), extra.end());
  return bytes;
}

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
    const Bytes jpeg = FlatJpeg("200", extra);
    const auto image = Ok(DecodeImage(jpeg, "a.jpg"));
    EXPECT_EQ(image->width, 8);
    EXPECT_EQ(image->height, 16);
    EXPECT_EQ(OrientationOf(jpeg), 6);
  }
  EXPECT_EQ(DecodeImage(FlatJpeg("200", xmp), "a.jpg").value().width, 16);
}

// Adobe stores inks inverted: 255 is none. R = C' K' / 255.
TEST(Jpeg, OfFourInks) {
  ExpectColor(DecodeImage(FlatJpeg("255_100_50_200", Adobe(0)), "a.jpg"), {200, 78, 39});
  // YCCK: Y 100, no colour, is 100 of each ink's complement; as stb_image has it, inverted.
  const auto ycck = DecodeImage(FlatJpeg("100_128_128_255", Adobe(2)), "a.jpg");
  ExpectColor(ycck, {155, 155, 155});
}

TEST(Jpeg, OfFourInksThatDoesNotSayHow) {
  for (const std::string& extra :
       {std::string(), Adobe(1), "\xff\xee" + Big(8, 2) + std::string("Other!")}) {
    ExpectMessage(DecodeImage(FlatJpeg("255_100_50_200", extra), "a.jpg").status(), "a.jpg",
                  "four components", "RGB");
  }
}

TEST(Jpeg, OfThreeComponentsIsYCbCrUnlessAdobeSaysRgb) {
  ExpectColor(DecodeImage(FlatJpeg("76_85_255", ""), "a.jpg"), {254, 0, 0});
  ExpectColor(DecodeImage(FlatJpeg("76_85_255", Adobe(0)), "a.jpg"), {76, 85, 255});
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

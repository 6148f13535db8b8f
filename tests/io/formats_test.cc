// SPDX-License-Identifier: Apache-2.0
// Images, npy and npz, zip archives, Java properties: round trips and broken files.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <zlib.h>

#include <cmath>
#include <numeric>

#include "io/archive.h"
#include "io/image_file.h"
#include "io/npz.h"
#include "io/samples.h"
#include "io/sh3f.h"
#include "support/temp_folder.h"

namespace tilegrad::io::formats_test {

class FormatsTest : public TempFolderTest {};

ImageU8 Gradient(int width, int height, int channels) {
  ImageU8 image(width, height, channels);
  std::iota(image.pixels.begin(), image.pixels.end(), std::uint8_t{0});
  return image;
}

TEST_F(FormatsTest, PngRoundTripForEveryChannelCount) {
  for (int channels = 1; channels <= 4; ++channels) {
    const ImageU8 image = Gradient(7, 5, channels);
    ASSERT_TRUE(SavePng(folder_ / "a.png", image).ok());
    const auto back = Ok(LoadImage(folder_ / "a.png"));
    EXPECT_EQ(back->channels, channels);
    EXPECT_EQ(back->pixels, image.pixels);
  }
  EXPECT_FALSE(EncodePng(ImageU8{}).ok());
}

TEST_F(FormatsTest, PngWithALyingHeader) {
  Bytes png = EncodePng(Gradient(8, 8, 3)).value();
  png[16] = 0x7f;  // width: over two thousand million pixels
  ExpectMessage(LoadImage(Write("lie.png", png)).status(), "lie.png");
  for (const std::uint8_t width : {3, 200}) {  // the data is too long, too short
    Bytes other = EncodePng(Gradient(8, 8, 3)).value();
    other[19] = width;
    ExpectMessage(LoadImage(Write("other.png", other)).status(), "other.png", "checksum", "byte 8");
  }
}

// By their content: people rename what they have been sent.
TEST_F(FormatsTest, ImagesOfOtherFormatsAreNamed) {
  using namespace std::string_literals;
  for (const auto& [bytes, format] : std::vector<std::pair<std::string, std::string>>{
           {"\0\0\0\x18"s + "ftypheic\0\0\0\0"s, "in HEIC"},
           {"\0\0\0\x1c"s + "ftypavif\0\0\0\0"s, "in AVIF"},
           {"GIF89a\2\0\2\0"s, "in GIF"},
           {"II*\0\x08\0\0\0"s, "in TIFF"},
           {"P3\n1 1\n255\n1 2 3\n", "in text or bitmap PNM"},
           {"<svg xmlns=\"http://www.w3.org/2000/svg\"/>", "in SVG"}}) {
    ExpectMessage(LoadImage(Write("photo.jpg", bytes)).status(), "photo.jpg", format, "save it as");
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(LoadImage(Write("cut.jpg", bytes.substr(0, size))).ok());
  }
}

// A header with a right checksum that promises a gigabyte.
TEST_F(FormatsTest, PngThatPromisesMoreThanItCanHold) {
  Bytes png = EncodePng(Gradient(8, 8, 4)).value();
  for (const std::size_t at : {18u, 22u}) png[at] = 0x3f;  // 16,136 x 16,136
  const auto crc = static_cast<std::uint32_t>(crc32(0, &png[12], 17));
  for (int i = 0; i < 4; ++i) png[29 + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
  ExpectMessage(LoadImage(Write("bomb.png", png)).status(), "bomb.png", "16136 x 16136",
                "can hold");
}

TEST_F(FormatsTest, CutFilesAreErrors) {
  const Bytes jpeg = StoredSample("noise_40x24.jpg");
  EXPECT_EQ(Ok(DecodeImage(jpeg, "a.jpg"))->width, 40);
  const auto decode = [](const Bytes& cut) { return DecodeImage(cut, "cut").status(); };
  ExpectCutsRefused(jpeg, "cut", decode, 5);
  ExpectCutsRefused(EncodePng(Gradient(64, 64, 4)).value(), "cut", decode, 13);
  ExpectMessage(LoadImage(Write("text.png", "not an image")).status(), "text.png",
                "not an image that can be read");
  ASSERT_TRUE(WriteZip(folder_ / "a.zip", {{"x", Bytes(1000, 5)}, {"y", Bytes(10, 1)}}).ok());
  ExpectCutsRefused(
      ReadFile(folder_ / "a.zip").value(), "cut.zip",
      [&](const Bytes& cut) { return OpenZip(Write("cut.zip", cut)).status(); }, 7);
}

TEST_F(FormatsTest, JpegWithTooManyHuffmanCodes) {
  Bytes jpeg = StoredSample("noise_16x16.jpg");
  const std::array<std::uint8_t, 2> marker = {0xff, 0xc4};
  const auto table = std::search(jpeg.begin(), jpeg.end(), marker.begin(), marker.end());
  ASSERT_NE(table, jpeg.end());
  table[5] = 255;  // codes of one bit; the other counts are added
  ExpectMessage(LoadImage(Write("codes.jpg", jpeg)).status(), "codes.jpg", "Huffman tables");
  // Bytes of filler before the first marker hid the file from the check, not from stb_image.
  jpeg.insert(jpeg.begin(), 2, 0xff);
  ExpectMessage(LoadImage(Write("codes.jpg", jpeg)).status(), "codes.jpg", "Huffman tables");
  Bytes filled = StoredSample("noise_16x16.jpg");
  filled.insert(filled.begin(), 2, 0xff);
  EXPECT_TRUE(DecodeImage(filled, "filled.jpg").ok());
}

TEST_F(FormatsTest, JpegOfManyScans) {
  const Bytes jpeg = StoredSample("noise_16x16.jpg");
  const std::array<std::uint8_t, 2> marker = {0xff, 0xda};
  const auto scan = std::search(jpeg.begin(), jpeg.end(), marker.begin(), marker.end());
  ASSERT_NE(scan, jpeg.end());
  Bytes many(jpeg.begin(), scan);
  for (int i = 0; i < 100; ++i) many.insert(many.end(), scan, jpeg.end() - 2);
  many.insert(many.end(), jpeg.end() - 2, jpeg.end());
  EXPECT_TRUE(DecodeImage(many, "many.jpg").ok());
  many.insert(many.end() - 2, scan, jpeg.end() - 2);
  ExpectMessage(DecodeImage(many, "many.jpg").status(), "many.jpg", "100 scans");
}

// 4294967298 = 2^32 + 2 was read as 2.
TEST_F(FormatsTest, PnmWithNumbersBeyondInt) {
  const auto decode = [](const std::string& text) {
    return DecodeImage(Bytes(text.begin(), text.end()), "a.ppm").status();
  };
  EXPECT_TRUE(decode("P6\n# 4294967298 is a comment\n2 0002\n255\n4294967298.,").ok());
  ExpectMessage(decode("P6\n4294967298 2\n255\n0123456789ab"), "a.ppm", "huge");
  ExpectMessage(decode("P5\n4 1#c\n4294967551\n0123"), "a.ppm", "huge");
}

Result<ImageU8> DecodeText(const std::string& text) {
  return DecodeImage(Bytes(text.begin(), text.end()), "a.pgm");
}

// What was missing used to be whatever was in memory.
TEST_F(FormatsTest, PnmSamplesAreScaledAndAllThere) {
  EXPECT_EQ(DecodeText("P5 4 1 15\n" + std::string("\0\1\17\20", 4))->pixels,
            (std::vector<std::uint8_t>{0, 17, 255, 255}));
  EXPECT_EQ(DecodeText("P5 3 1 2\n" + std::string("\0\1\2", 3))->pixels,
            (std::vector<std::uint8_t>{0, 128, 255}));  // 127.5 is rounded
  EXPECT_EQ(DecodeText("P5 2 1 65535 " + std::string("\x12\x34\xff\xff", 4))->pixels,
            (std::vector<std::uint8_t>{0x12, 255}));
  EXPECT_EQ(DecodeText("P6#c\r1 #\n 1 255\nabc")->pixels,
            (std::vector<std::uint8_t>{'a', 'b', 'c'}));
  ExpectMessage(DecodeText("P5 4 1 255\nabc").status(), "a.pgm", "truncated", "need 4 bytes");
  ExpectMessage(DecodeText("P5 2 1 256\nabc").status(), "a.pgm", "truncated", "need 4 bytes");
  for (const char* header :
       {"P5 ", "P5 4", "P5 4 1", "P5 4 1 ", "P5 4 1 0\nabcd", "P5 4 1 65536\nabcd", "P5 0 1 255\n",
        "P5 16385 1 255\n", "P5 -1 1 255\n"}) {
    ExpectMessage(DecodeText(header).status(), "a.pgm");
  }
}

Bytes LittleEndian(std::initializer_list<std::pair<int, int>> numbers_and_sizes) {
  Bytes out;
  for (const auto& [number, size] : numbers_and_sizes) {
    for (int i = 0; i < size; ++i)
      out.push_back(i < 4 ? static_cast<std::uint8_t>(number >> 8 * i) : std::uint8_t{0});
  }
  return out;
}

// Two pixels wide, a palette of two colours where there are 8 bits a pixel.
Bytes Bmp(int height, int bits, const Bytes& rows) {
  const int colors = bits == 8 ? 2 : 0, offset = 54 + 4 * colors;
  Bytes out = LittleEndian({{0x4d42, 2},
                            {0, 8},
                            {offset, 4},
                            {40, 4},
                            {2, 4},
                            {height, 4},
                            {1, 2},
                            {bits, 2},
                            {0, 16},
                            {colors, 4},
                            {0, 4}});
  if (colors > 0) out.insert(out.end(), {1, 2, 3, 0, 4, 5, 6, 0});
  out.insert(out.end(), rows.begin(), rows.end());
  return out;
}

TEST_F(FormatsTest, BmpPixelsAreAllThere) {
  const Bytes rows = {1, 2, 3, 4, 5, 6, 0, 0, 11, 12, 13, 14, 15, 16, 0, 0};
  const std::vector<std::uint8_t> first = {3, 2, 1, 6, 5, 4}, second = {13, 12, 11, 16, 15, 14};
  for (const bool from_top : {false, true}) {
    const auto image = Ok(DecodeImage(Bmp(from_top ? -2 : 2, 24, rows), "a.bmp"));
    ASSERT_EQ(image->pixels.size(), 12u);
    EXPECT_TRUE(std::equal(first.begin(), first.end(), image->at(0, from_top ? 0 : 1)));
    EXPECT_TRUE(std::equal(second.begin(), second.end(), image->at(0, from_top ? 1 : 0)));
  }
  Bytes whole = Bmp(2, 24, rows);
  whole.resize(whole.size() - 2);  // the last row's padding
  EXPECT_TRUE(DecodeImage(whole, "a.bmp").ok());
  ExpectCutsRefused(whole, "a.bmp",
                    [](const Bytes& cut) { return DecodeImage(cut, "a.bmp").status(); });
  for (const int height : {0, -16385, -2147483647 - 1})
    ExpectMessage(DecodeImage(Bmp(height, 24, rows), "a.bmp").status(), "a.bmp", "2 x");
}

TEST_F(FormatsTest, BmpColoursAreInThePalette) {
  const auto image = Ok(DecodeImage(Bmp(1, 8, {1, 0, 99, 99}), "a.bmp"));
  EXPECT_EQ(image->pixels, (std::vector<std::uint8_t>{6, 5, 4, 3, 2, 1}));
  ExpectMessage(DecodeImage(Bmp(1, 8, {1, 2, 0, 0}), "a.bmp").status(), "a.bmp", "palette of 2");
}

Bytes Tga(int type, int bits, const Bytes& data) {
  Bytes out = LittleEndian({{0, 2}, {type, 1}, {0, 9}, {2, 2}, {2, 2}, {bits, 1}, {0x20, 1}});
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

TEST_F(FormatsTest, TgaPixelsAreAllThere) {
  const Bytes raw = Tga(2, 24, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}),
              packed = Tga(10, 24, {0x00, 1, 2, 3, 0x81, 4, 5, 6, 0x00, 7, 8, 9}),
              grey = Tga(3, 8, {1, 2, 3, 4});
  for (const Bytes& whole : {raw, packed, grey}) {
    const auto image = Ok(DecodeImage(whole, "a.tga"));
    EXPECT_EQ(image->pixels[0], whole == grey ? 1 : 3);
    ExpectCutsRefused(whole, "a.tga",
                      [](const Bytes& cut) { return DecodeImage(cut, "a.tga").status(); });
  }
}

TEST_F(FormatsTest, NpzRoundTrip) {
  const std::vector<float> f = {1.5f, -2, 3};
  const std::vector<std::uint8_t> u(24, 7);
  const std::vector<std::int64_t> empty;
  Ok(SaveNpz(folder_ / "a.npz", {{"f", MakeNpy<float>({3}, f)},
                                 {"u", MakeNpy<std::uint8_t>({2, 3, 4}, u)},
                                 {"e", MakeNpy<std::int64_t>({0, 5}, empty)}}));
  const auto back = Ok(LoadNpz(folder_ / "a.npz"));
  EXPECT_EQ(back->at("f").As<float>().value(), f);
  EXPECT_EQ(back->at("u").shape, (std::vector<std::size_t>{2, 3, 4}));
  EXPECT_EQ(back->at("e").count(), 0u);
  ExpectMessage(back->at("f").As<double>().status(), "float64", "float32");
  ExpectMessage(LoadNpzArray(folder_ / "a.npz", "x").status(), "a.npz", "\"x\"", "f.npy");
  const Bytes first = ReadFile(folder_ / "a.npz").value();
  ASSERT_TRUE(SaveNpz(folder_ / "b.npz", *back).ok());
  EXPECT_EQ(ReadFile(folder_ / "b.npz").value(), first);
}

Bytes NpyWithHeader(const std::string& dictionary, std::size_t data) {
  std::string header = dictionary;
  header.resize(118 - 1, ' ');
  std::string text = "\x93NUMPY";
  text += {1, 0, 118, 0};
  text += header + "\n" + std::string(data, '\1');
  return {text.begin(), text.end()};
}

TEST_F(FormatsTest, NpyAsNumpyWritesIt) {
  const auto array = Ok(DecodeNpy(
      NpyWithHeader("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", 24), "a.npy"));
  EXPECT_EQ(array->shape, (std::vector<std::size_t>{2, 3}));
  const auto scalar = Ok(DecodeNpy(
      NpyWithHeader("{'descr': '|u1', 'fortran_order': False, 'shape': (), }", 1), "s.npy"));
  EXPECT_EQ(scalar->count(), 1u);
  EXPECT_EQ(DecodeNpy(NpyWithHeader("{'descr': '|b1', 'fortran_order': False, 'shape': (4,), }", 4),
                      "b.npy")
                ->As<std::uint8_t>()
                .value()
                .size(),
            4u);
}

// An archive as numpy.savez_compressed writes it: deflated, with 64-bit sizes in the local header.
constexpr std::string_view kNumpyArchive =
    "504b03042d0000000800000021007c9cdea2ffffffffffffffff05001400612e6e7079010010009800000000"
    "00000058000000000000009bec17ea1b10c9c850c650ad9e925a9c5ca46ea5a06e9366a2aea3a09e965f5452"
    "9498179f5f94920a12774bcc294e058a17672416a402f91a463a0ac69a3a0ab50a64032e0686067b06060607"
    "2002e206205e00c4071c00504b01022d032d0000000800000021007c9cdea258000000980000000500000000"
    "00000000000000800100000000612e6e7079504b05060000000001000100330000008f0000000000";

// 1, -2, the largest, the smallest, -0 and infinity.
TEST_F(FormatsTest, HalvesBecomeFloats) {
  Bytes bytes = NpyWithHeader("{'descr': '<f2', 'fortran_order': False, 'shape': (6,), }", 0);
  for (const int half : {0x3c00, 0xc000, 0x7bff, 0x0001, 0x8000, 0x7c00})
    bytes.insert(bytes.end(),
                 {static_cast<std::uint8_t>(half & 255), static_cast<std::uint8_t>(half >> 8)});
  const auto values = Ok(DecodeNpy(bytes, "f"))->As<float>().value();
  EXPECT_EQ(values, (std::vector<float>{1, -2, 65504, 0x1p-24f, 0, HUGE_VALF}));
  EXPECT_TRUE(std::signbit(values[4]));
}

TEST_F(FormatsTest, NpzAsNumpyWritesIt) {
  Bytes bytes;
  for (std::size_t i = 0; i < kNumpyArchive.size(); i += 2)
    bytes.push_back(
        static_cast<std::uint8_t>(std::stoi(std::string(kNumpyArchive.substr(i, 2)), nullptr, 16)));
  const auto array = Ok(LoadNpzArray(Write("numpy.npz", bytes), "a"));
  EXPECT_EQ(array->shape, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(array->As<float>().value(), (std::vector<float>{1, 2, 3, 4, 5, 6}));
  ExpectCutsRefused(
      bytes, "cut.npz", [&](const Bytes& cut) { return LoadNpz(Write("cut.npz", cut)).status(); },
      3);
}

TEST_F(FormatsTest, SavingAnArrayWhoseShapeIsNotItsSize) {
  NpyArray array = MakeNpy<float>({3}, std::vector<float>(3));
  array.shape = {4};
  ExpectMessage(SaveNpz(folder_ / "a.npz", {{"x", array}}), "a.npz", "\"x\"", "16 bytes", "12");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.npz"));
}

TEST_F(FormatsTest, FortranOrderIsConverted) {
  Bytes bytes = NpyWithHeader("{'descr': '|u1', 'fortran_order': True, 'shape': (2, 3), }", 6);
  const std::size_t begin = bytes.size() - 6;
  for (std::uint8_t i = 0; i < 6; ++i) bytes[begin + i] = i;  // columns (0,1), (2,3), (4,5)
  EXPECT_EQ(DecodeNpy(bytes, "f").value().data, (Bytes{0, 2, 4, 1, 3, 5}));
}

TEST_F(FormatsTest, BrokenNpyHeadersAreErrors) {
  const auto error = [](const std::string& dictionary, std::size_t data) {
    return DecodeNpy(NpyWithHeader(dictionary, data), "bad.npy").status();
  };
  ExpectMessage(
      error("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000, 1000000000), }", 8),
      "bad.npy", "declares");
  ExpectMessage(
      error("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,), }", 8),
      "bad.npy");
  ExpectMessage(error("{'descr': '<f4', 'fortran_order': False, 'shape': (4000000000, 4000000000, "
                      "4000000000), }",
                      8),
                "2^64");
  ExpectMessage(error("{'descr': '>f4', 'fortran_order': False, 'shape': (2,), }", 8),
                "big-endian");
  ExpectMessage(error("{'descr': '|O', 'fortran_order': False, 'shape': (2,), }", 16), "|O");
  ExpectMessage(error("nonsense", 8), "header");
  ExpectMessage(error("{'descr': '<f4', 'fortran_order': Maybe, 'shape': (2,), }", 8), "header");
  ExpectMessage(DecodeNpy(Bytes(5, 0), "short.npy").status(), "short.npy");
}

TEST_F(FormatsTest, APipeIsNoZip) {
  ASSERT_EQ(::mkfifo((folder_ / "a.npz").c_str(), 0600), 0);
  ExpectMessage(LoadNpz(folder_ / "a.npz").status(), "a.npz", "not a regular file");
}

TEST_F(FormatsTest, CorruptZipEntryIsAnError) {
  Bytes noise(4096);
  for (std::size_t i = 0; i < noise.size(); ++i)
    noise[i] = static_cast<std::uint8_t>(i * i * 31 >> 3);
  ASSERT_TRUE(WriteZip(folder_ / "a.zip", {{"x", noise}}).ok());
  Bytes bytes = ReadFile(folder_ / "a.zip").value();
  bytes[200] ^= 0xff;
  const auto zip = Ok(OpenZip(Write("bad.zip", bytes)));
  ExpectMessage((*zip)->Read("x").status(), "bad.zip");
}

TEST_F(FormatsTest, NamesNeverLeaveTheSource) {
  EXPECT_FALSE(NormalizeName("../secret").has_value());
  EXPECT_FALSE(NormalizeName("/etc/passwd").has_value());
  EXPECT_FALSE(NormalizeName("a/../../b").has_value());
  EXPECT_EQ(NormalizeName("a\\b\\..\\c").value(), "a/c");
  EXPECT_EQ(OpenFolder(folder_)->Read("../x").status().code(), StatusCode::kNotFound);
}

TEST_F(FormatsTest, PropertiesOfJava) {
  const std::string text =
      "# comment\n! too\nkey#1 = value one\nlong=first \\\n   "
      "second\nuni=\\u00e9\\n\xe9\nempty=\ncolon:x=y\n";
  const auto p = ParseProperties(Bytes(text.begin(), text.end()));
  ASSERT_EQ(p.size(), 5u);
  EXPECT_EQ(p[0], (std::pair<std::string, std::string>("key#1", "value one")));
  EXPECT_EQ(p[1].second, "first second");
  EXPECT_EQ(p[2].second, "\xc3\xa9\n\xc3\xa9");
  EXPECT_EQ(p[3].second, "");
  EXPECT_EQ(p[4], (std::pair<std::string, std::string>("colon", "x=y")));
}

TEST_F(FormatsTest, FurnitureCatalog) {
  const std::string text =
      "license=CC0\nid#1=a\nname#1=Chair\nmodel#1=/a/a.obj\nwidth#1=50\ndepth#1=40\nheight#1=90\n"
      "modelRotation#1=0 0 1 -1 0 0 0 -1 0\nid#2=b\nname#2=No model\n";
  Ok(WriteZip(folder_ / "a.sh3f",
              {{"PluginFurnitureCatalog.properties", Bytes(text.begin(), text.end())}}));
  const auto catalog = Ok(ReadFurnitureCatalog(**OpenZip(folder_ / "a.sh3f")));
  ASSERT_EQ(catalog->entries.size(), 1u);
  EXPECT_EQ(catalog->entries[0].model, "a/a.obj");
  Mesh mesh;
  mesh.positions = {{1, 2, 3}};
  ApplyRotation(mesh, *catalog->entries[0].rotation);
  EXPECT_EQ(mesh.positions[0], glm::vec3(3, -1, -2));
}

}  // namespace tilegrad::io::formats_test

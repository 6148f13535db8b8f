// SPDX-License-Identifier: Apache-2.0
// What files cannot hold is refused before it is lost, and what is too large is called so.
#include <gtest/gtest.h>

#include "io/exr_file.h"
#include "io/image_file.h"
#include "io/npz.h"
#include "support/temp_folder.h"

namespace tilegrad::io::refusals_test {

using Refusals = TempFolderTest;

void ExpectTooLarge(const Bytes& bytes, const std::string& size) {
  const auto image = DecodeImage(bytes, "big");
  ExpectMessage(image.status(), "big", size + " pixels", "16384");
  EXPECT_EQ(image.status().message().find("nknown"), std::string::npos);
}

TEST_F(Refusals, ImagesAboveTheLimitAreCalledSo) {
  ExpectTooLarge(EncodePng(ImageU8(16385, 1, 1)).value(), "16385 x 1");
  ExpectTooLarge(EncodePng(ImageU8(1, 20000, 3)).value(), "1 x 20000");
  const Bytes jpeg = {0xff, 0xd8, 0xff, 0xff, 0xc0, 0,    11, 8,    0,  // precision
                      7,    0x4e, 0x20, 1,    1,    0x11, 0,  0xff, 0xd9};
  ExpectTooLarge(jpeg, "20000 x 7");
  Bytes bmp(60);
  bmp[0] = 'B';
  bmp[1] = 'M';
  bmp[10] = 54;
  bmp[14] = 40;
  bmp[18] = 0x20;
  bmp[19] = 0x4e;
  bmp[22] = 5;
  bmp[26] = 1;
  bmp[28] = 24;
  ExpectTooLarge(bmp, "20000 x 5");
  Bytes tga(40);
  tga[2] = 2;
  tga[12] = 3;
  tga[14] = 0x20;
  tga[15] = 0x4e;
  tga[16] = 24;
  ExpectTooLarge(tga, "3 x 20000");
}

TEST_F(Refusals, EveryByteStringIsStillAnError) {
  for (const std::string& text : {std::string(), std::string("BM"), std::string("\xff\xd8\xff\xc0"),
                                  std::string("\x89PNG\r\n\x1a\n"), std::string(18, '\1')}) {
    EXPECT_FALSE(DecodeImage(Bytes(text.begin(), text.end()), "x").ok());
  }
}

TEST_F(Refusals, ExrNamesThatWouldBeCut) {
  const std::vector<float> one(1), two(1, 2);
  const auto save = [&](const std::string& a, const std::string& b) {
    return SaveExr(folder_ / "a.exr", {1, 1, {{a, one}, {b, two}}});
  };
  const std::string most(255, 'n');
  ExpectMessage(save(std::string("R\0a", 3), std::string("R\0b", 3)), "\"R\"", "NUL");
  ExpectMessage(save(most + "a", most + "b"), "255", "nnnn");
  ExpectMessage(save("G", most + "a"), "255");
  ExpectMessage(save("G", std::string("\0", 1)), "NUL");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a.exr"));
  ASSERT_TRUE(save("G", most).ok());
  const auto back = LoadExr(folder_ / "a.exr");
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ(back->names, (std::vector<std::string>{"G", most}));
  EXPECT_EQ(back->values, (std::vector<float>{0, 2}));
}

TEST_F(Refusals, NpzNamesComeBackOrAreRefused) {
  const Path file = folder_ / "a.npz";
  const float value = 7;
  for (const std::string& name :
       {std::string("a\0b", 3), std::string("\0", 1), std::string("a\\b"), std::string("../a"),
        std::string("/a"), std::string("a/./b"), std::string("a//b"), std::string("a/../b"),
        std::string("layer/weight"), std::string("a b"), std::string("..a"), std::string("A"),
        std::string("."), std::string(65531, 'n'), std::string(65532, 'n'),
        std::string(70000, 'n')}) {
    SCOPED_TRACE(name.substr(0, 20));
    NpzArrays arrays;
    arrays[name] = MakeNpy<float>({1}, std::span(&value, 1));
    arrays["a"] = MakeNpy<float>({0}, {});
    std::filesystem::remove(file);
    const Status saved = SaveNpz(file, arrays);
    if (!saved.ok()) {
      EXPECT_EQ(saved.code(), StatusCode::kInvalidArgument);
      EXPECT_FALSE(std::filesystem::exists(file));
      continue;
    }
    const auto back = LoadNpz(file);
    ASSERT_TRUE(back.ok()) << back.status().message();
    ASSERT_EQ(back->size(), 2u);
    ASSERT_EQ(back->count(name), 1u);
    EXPECT_EQ(back->at(name).data, arrays[name].data);
  }
  ExpectMessage(SaveNpz(file, {{std::string("a\0b", 3), {}}}), "a.npz", "\"a\"", "NUL");
  ExpectMessage(SaveNpz(file, {{std::string(65532, 'n'), {}}}), "a.npz", "nnnn", "65531 bytes");
  ExpectMessage(SaveNpz(file, {{"\xff", MakeNpy<float>({0}, {})}}), "a.npz");
}

TEST_F(Refusals, NpzWithoutArrays) {
  const Path file = folder_ / "a.npz";
  ExpectMessage(SaveNpz(file, {}), "a.npz", "no array");
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace tilegrad::io::refusals_test

// SPDX-License-Identifier: Apache-2.0
// What files cannot hold is refused before it is lost, and what is too large is called so.
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "base/read_budget.h"
#include "io/exr_file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::refusals_test {

using Refusals = TempFolderTest;

void ExpectTooLarge(const Bytes& bytes, const std::string& size) {
  const auto image = DecodeImage(bytes, "big");
  ExpectMessage(image.status(), "big", size + " pixels", "16384");
  ExpectNotIn(image.status().message(), "nknown");
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
  const auto back = Ok(LoadExr(folder_ / "a.exr"));
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
    const auto back = Ok(LoadNpz(file));
    ASSERT_EQ(back->size(), 2u);
    ASSERT_EQ(back->count(name), 1u);
    EXPECT_EQ(back->at(name).data, arrays[name].data);
  }
  ExpectMessage(SaveNpz(file, {{std::string("a\0b", 3), {}}}), "a.npz", "\"a\"", "NUL");
  ExpectMessage(SaveNpz(file, {{std::string(65532, 'n'), {}}}), "a.npz", "nnnn", "65531 bytes");
  ExpectMessage(SaveNpz(file, {{"\xff", MakeNpy<float>({0}, {})}}), "a.npz");
}

// One limit for a file and all that it names or packs, in every container; what is within is read.
constexpr int kSide = 512;
constexpr std::size_t kPicture = std::size_t{3} * kSide * kSide;  // bytes of one, decoded

class ReadLimitTest : public TempFolderTest {
 protected:
  // `load` needs `bytes` and little more: it is read with twice that, and refused with half.
  template <class Load>
  void ExpectLimit(std::size_t bytes, const Load& load) {
    {
      const ReadBudget enough(2 * bytes);
      Ok(load().status());
    }
    const ReadBudget little(bytes / 2);
    const Status status = load().status();
    EXPECT_EQ(status.code(), StatusCode::kResourceExhausted) << status.message();
    ExpectMessage(status, folder_.string(), "TILEGRAD_READ_LIMIT");
  }

  // A sphere of `textures` materials, each with a picture of its own.
  static Mesh Pictures(int textures) {
    Mesh mesh = Icosphere(1, 1);
    mesh.corner_uvs.assign(3 * mesh.faces.size(), {0.5f, 0.5f});
    for (int t = 0; t < textures; ++t) {
      ImageU8 image(kSide, kSide, 3);
      image.pixels[0] = static_cast<std::uint8_t>(t);
      mesh.textures.push_back({"picture " + std::to_string(t), std::move(image)});
      mesh.materials.push_back({.name = std::to_string(t), .base_color_texture = t});
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      mesh.face_materials.push_back(static_cast<std::int32_t>(f) % textures);
    }
    return mesh;
  }
};

TEST_F(ReadLimitTest, PicturesOfAGlb) {
  const Path file = folder_ / "a.glb";
  ASSERT_TRUE(SaveGlb(file, Pictures(20)).ok());
  EXPECT_LT(std::filesystem::file_size(file), kPicture / 4);
  ExpectLimit(20 * kPicture, [&] { return LoadMesh(file); });
}

TEST_F(ReadLimitTest, PicturesOfAnObj) {
  std::string obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n", mtl;
  for (int t = 0; t < 10; ++t) {
    const std::string name = "p" + std::to_string(t);
    ASSERT_TRUE(SavePng(folder_ / (name + ".png"), ImageU8(kSide, kSide, 3)).ok());
    mtl += "newmtl " + name + "\nmap_Kd " + name + ".png\n";
    obj += "usemtl " + name + "\nf 1/1 2/1 3/1\n";
  }
  Write("a.mtl", mtl);
  const Path file = Write("a.obj", obj);
  ExpectLimit(10 * kPicture, [&] { return LoadMesh(file); });
}

TEST_F(ReadLimitTest, ArraysOfAnNpz) {
  NpzArrays arrays;
  const std::vector<std::uint8_t> zeros(1 << 20);
  for (const char* name : {"a", "b", "c", "d"}) {
    arrays[name] = MakeNpy<std::uint8_t>({zeros.size()}, zeros);
  }
  const Path file = folder_ / "a.npz";
  ASSERT_TRUE(SaveNpz(file, arrays).ok());
  ExpectLimit(std::size_t{4} << 20, [&] { return LoadNpz(file); });
  ExpectLimit(std::size_t{1} << 20, [&] { return LoadNpzArray(file, "b"); });
}

TEST_F(ReadLimitTest, ImagesAlone) {
  ASSERT_TRUE(SavePng(folder_ / "a.png", ImageU8(kSide, kSide, 3)).ok());
  ExpectLimit(kPicture, [&] { return LoadImage(folder_ / "a.png"); });
  const std::vector<float> plane(kSide * kSide);
  Ok(SaveExr(folder_ / "a.exr", {kSide, kSide, {{"R", plane}, {"G", plane}, {"Z", plane}}}));
  EXPECT_TRUE(LoadExr(folder_ / "a.exr").ok());
  {
    const ReadBudget little(kPicture);
    ExpectMessage(LoadExr(folder_ / "a.exr").status(), "a.exr", "TILEGRAD_READ_LIMIT");
  }
  const Path pgm = Write("a.pgm", "P5 100 100 255\n" + std::string(10000, 'x'));
  ExpectLimit(20000, [&] { return LoadImage(pgm); });  // the file itself counts
}

TEST_F(ReadLimitTest, EachFileHasItsOwn) {
  const Path file = folder_ / "a.glb";
  ASSERT_TRUE(SaveGlb(file, Pictures(2)).ok());
  setenv("TILEGRAD_READ_LIMIT", std::to_string(3 * kPicture).c_str(), 1);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(LoadMesh(file).ok());
  setenv("TILEGRAD_READ_LIMIT", std::to_string(kPicture).c_str(), 1);
  EXPECT_EQ(LoadMesh(file).status().code(), StatusCode::kResourceExhausted);
  unsetenv("TILEGRAD_READ_LIMIT");
  EXPECT_TRUE(LoadMesh(file).ok());
}

// Materials with numbers that are none, or too large: whoever reads or writes them says so.
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kMost = std::numeric_limits<float>::max();

Mesh Painted(glm::vec4 color) {
  Mesh mesh = Icosphere(0, 1);
  mesh.materials = {{.name = "paint", .base_color = color}};
  return mesh;
}

class HostileMaterials : public TempFolderTest {
 protected:
  // An error that names the file and the material, or a warning that does, and sound colours.
  void ExpectNamed(const Path& file) {
    const auto loaded = LoadMesh(file);
    if (!loaded.ok()) return ExpectMessage(loaded.status(), file.filename().string(), "paint");
    bool named = false;
    for (const std::string& warning : loaded->warnings) {
      named |= warning.find("paint") != std::string::npos;
    }
    EXPECT_TRUE(named) << file;
    EXPECT_TRUE(Validate(loaded->mesh).ok());
  }

  // A GLB whose n-th number of the base colour, counted from 0, is `number`.
  Path GlbWithFactor(int n, std::string number) {
    Mesh mesh = Painted({0.3f, 0.4f, 0.6f, 0.7f});
    const Bytes bytes = EncodeGlb(mesh).value();
    std::string text(bytes.begin(), bytes.end());
    std::size_t at = text.find("baseColorFactor\":[") + 18;
    for (; n > 0; --n) at = text.find(',', at) + 1;
    const std::size_t length = text.find_first_of(",]", at) - at;
    number.resize(length, ' ');
    return Write("factor.glb", text.replace(at, length, number));
  }
};

// AC3D's errors name the line; OFF has no word for a colour that is none, and leaves it out. OBJ
// and MTL: obj_test.cc.
TEST_F(HostileMaterials, OfOtherFormatsAreNamed) {
  const std::string object =
      "OBJECT poly\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x0\nmat 0\nrefs 3\n0 0 0\n"
      "1 0 0\n2 0 0\nkids 0\n";
  for (const char* numbers : {"rgb nan 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0",
                              "rgb 1e39 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0",
                              "rgb 1 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans -inf"}) {
    const Path file =
        Write("a.ac", std::string("AC3Db\nMATERIAL \"m\" ") + numbers + "\n" + object);
    ExpectMessage(LoadMesh(file).status(), "a.ac: line 2", "finite");
  }
  for (const char* color : {"nan 0 0", "0 inf 0 1", "1e39 0 0"}) {
    const auto loaded = Ok(LoadMesh(
        Write("a.off", std::string("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 ") + color + "\n")));
    EXPECT_TRUE(loaded->mesh.corner_colors.empty());
    EXPECT_EQ(loaded->warnings.size(), 1u);
  }
}

TEST_F(HostileMaterials, OfGltfFilesAreNamed) {
  ASSERT_TRUE(LoadMesh(GlbWithFactor(0, "0.25")).ok());
  for (const char* number : {"1e39", "-1e39", "1e300"}) {
    for (const int n : {0, 2, 3}) {
      SCOPED_TRACE(number);
      ExpectNamed(GlbWithFactor(n, number));
    }
  }
}

TEST_F(HostileMaterials, AreNotSavedAsWhite) {
  const Path file = folder_ / "out.glb";
  for (const float bad : {kNan, kInf, -kInf, kMost}) {
    ExpectMessage(SaveGlb(file, Painted({1, bad, 1, 1})), "materials[0]", "paint", "base_color");
  }
  ExpectMessage(SaveGlb(file, Painted({1, 1, 1, kNan})), "paint", "base_color[3]");
  Mesh mesh = Painted({1, 1, 1, 1});
  mesh.colors.assign(mesh.positions.size(), {1, 1, 1, 1});
  mesh.colors[3].g = kMost;
  ExpectMessage(SaveGlb(file, mesh), "colors[3]", "too large");
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace tilegrad::io::refusals_test

// SPDX-License-Identifier: Apache-2.0
// One limit for a file and all that it names or packs, in every container; what is within is read.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "base/read_budget.h"
#include "io/exr_file.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::read_limit_test {

constexpr int kSide = 512;
constexpr std::size_t kPicture = std::size_t{3} * kSide * kSide;  // bytes of one, decoded

class ReadLimitTest : public TempFolderTest {
 protected:
  // `load` needs `bytes` and little more: it is read with twice that, and refused with half.
  template <class Load>
  void ExpectLimit(std::size_t bytes, const Load& load) {
    {
      const ReadBudget enough(2 * bytes);
      const Status status = load().status();
      EXPECT_TRUE(status.ok()) << status.message();
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
  ASSERT_TRUE(
      SaveExr(folder_ / "a.exr", {kSide, kSide, {{"R", plane}, {"G", plane}, {"Z", plane}}}).ok());
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

}  // namespace tilegrad::io::read_limit_test

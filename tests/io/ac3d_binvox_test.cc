// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "io/binvox.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::ac3d_binvox_test {

class Ac3dTest : public TempFolderTest {
 protected:
  Status Load(const std::string& text) { return LoadMesh(Write("bad.ac", text)).status(); }
};

const std::string kHead =
    "AC3Db\nMATERIAL \"red paint\" rgb 1 0 0  amb 0.2 0.2 0.2  emis 0 0 0  spec 0.5 0.5 0.5  shi "
    "10 "
    " trans 0.25\nMATERIAL \"white\" rgb 1 1 1 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n";

const std::string kTriangle =
    "numvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x20\nmat 0\nrefs 3\n0 0 0\n1 1 0\n2 0 1\n";

std::string World(const std::string& child) {
  return kHead + "OBJECT world\nkids 1\nOBJECT poly\n" + child + "kids 0\n";
}

TEST_F(Ac3dTest, MaterialsTexturesAndUvs) {
  ASSERT_TRUE(SavePng(folder_ / "my livery.png", ImageU8(2, 2, 3, 50)).ok());
  // The texture is the parent's, with another computer's path; data may hold anything.
  const auto loaded = Ok(LoadMesh(
      Write("a.ac", kHead +
                        "OBJECT world\nkids 1\nOBJECT group\nname \"a group\"\ndata 12\nkids "
                        "9\nSURFx\ntexture \"C:\\art\\my livery.png\"\nkids 2\n"
                        "OBJECT poly\ntexrep 2 3\ntexoff 0.5 0\nsubdiv 2\ncrease 45\n" +
                        kTriangle + "kids 0\nOBJECT poly\n" + kTriangle + "kids 0\n")));
  const Mesh& mesh = loaded->mesh;
  EXPECT_EQ(mesh.faces, (std::vector<Face>{{0, 1, 2}, {3, 4, 5}}));
  ASSERT_EQ(mesh.materials.size(), 1u);
  EXPECT_EQ(mesh.materials[0].name, "red paint");
  EXPECT_EQ(mesh.materials[0].base_color, glm::vec4(1, 0, 0, 0.75f));
  EXPECT_EQ(mesh.materials[0].base_color_texture, 0);
  EXPECT_EQ(mesh.corner_uvs,
            (std::vector<glm::vec2>{{0.5f, 0}, {2.5f, 0}, {0.5f, 3}, {0, 0}, {1, 0}, {0, 1}}));
  EXPECT_TRUE(loaded->warnings.empty());
}

TEST_F(Ac3dTest, ChildrenMoveWithTheirParents) {
  // A quarter turn about z takes x to y: rows of the matrix are written one after the other.
  const auto loaded = Ok(LoadMesh(Write(
      "a.ac", kHead +
                  "OBJECT world\nkids 1\nOBJECT group\nloc 10 0 0\nrot 0 -1 0 1 0 0 0 0 1\nkids "
                  "1\nOBJECT poly\nloc 1 0 0\n" +
                  kTriangle + "kids 0\n")));
  EXPECT_EQ(loaded->mesh.positions, (std::vector<glm::vec3>{{10, 1, 0}, {10, 2, 0}, {9, 1, 0}}));
}

TEST_F(Ac3dTest, ConcavePolygonsAndLines) {
  const auto loaded = Ok(LoadMesh(
      Write("a.ac", World("numvert 4\n-1 0 0\n0 -1 0\n-0.2 0 0\n0 1 0\nnumsurf 2\nSURF 0x00\nmat "
                          "1\nrefs 4\n0 0 0\n1 1 0\n2 0 1\n3 0 0\nSURF 0x02\nmat 0\nrefs 2\n0 0 "
                          "0\n1 0 0\n"))));
  ASSERT_EQ(loaded->mesh.faces.size(), 2u);
  for (const Face& f : loaded->mesh.faces)  // the notch at vertex 2 is a corner of both
    EXPECT_TRUE(f[0] == 2 || f[1] == 2 || f[2] == 2);
  ExpectOnly(loaded->warnings, "lines");
}

// As TORCS writes it: normals behind vertices, strips, layers of texture, a uv for each of them.
TEST_F(Ac3dTest, StripsAndLayersOfTorcs) {
  ASSERT_TRUE(SavePng(folder_ / "paint.png", ImageU8(2, 2, 3, 50)).ok());
  const auto loaded = Ok(LoadMesh(
      Write("car.acc", World("name \"body\"\ntexture \"paint.png\" base\n"
                             "texture \"none.rgb\" tiled\ntexture \"none.rgb\" skids\n"
                             "texture \"none.rgb\" shad\nnumvert 5\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 "
                             "0 0 0 1\n1 1 0 0 0 1\n0 2 0 0 0 1\nnumsurf 2\nSURF 0x34\nmat "
                             "1\nrefs 6\n0 0 0 9 9\n1 1 0 9 9\n2 0 1 9 9\n3 1 1 9 9\n3 1 1 9 "
                             "9\n4 0 2 9 9\nSURF 0x14\nmat 1\nrefs 2\n0 0 0\n1 0 0\n"))));
  EXPECT_TRUE(loaded->warnings.empty()) << loaded->warnings[0];
  // All counter-clockwise seen from +z; the repeated corner, which joins two strips, gives none.
  EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{0, 1, 2}, {1, 3, 2}}));
  EXPECT_EQ(loaded->mesh.corner_uvs,
            (std::vector<glm::vec2>{{0, 0}, {1, 0}, {0, 1}, {1, 0}, {1, 1}, {0, 1}}));
  ASSERT_EQ(loaded->mesh.textures.size(), 1u);
  EXPECT_EQ(loaded->mesh.textures[0].name, "paint.png");
  ASSERT_EQ(loaded->parts.size(), 1u);
  EXPECT_EQ(loaded->parts[0].name, "body");
}

TEST_F(Ac3dTest, EmissionIsSaid) {
  std::string lamp = World(kTriangle);
  lamp.replace(lamp.find("emis 0 0 0"), 10, "emis 0 0.5 0");
  const auto loaded = Ok(LoadMesh(Write("a.ac", lamp)));
  EXPECT_EQ(loaded->warnings, (std::vector<std::string>{"the emission of materials is not drawn"}));
}

TEST_F(Ac3dTest, PartsSayWhichFacesAnObjectHas) {
  const auto loaded = Ok(LoadMesh(
      Write("a.ac", kHead + "OBJECT world\nkids 2\nOBJECT poly\nname \"hull\"\n" + kTriangle +
                        "kids 0\nOBJECT poly\nname \"bow wake\"\n" + kTriangle + "kids 0\n")));
  ASSERT_EQ(loaded->parts.size(), 2u);
  EXPECT_EQ(loaded->parts[0].first_face, 0u);
  EXPECT_EQ(loaded->parts[1].name, "bow wake");
  EXPECT_EQ(loaded->parts[1].first_face, 1u);
}

TEST_F(Ac3dTest, IsReadBehindAByteOrderMarkAndNotCut) {
  const std::string whole = World(kTriangle);
  Ok(Load("\xef\xbb\xbf" + whole));
  ExpectCutsRefused(Bytes(whole.begin(), whole.end() - 2), "bad.ac", [&](const Bytes& cut) {
    return Load({cut.begin(), cut.end()});
  });
}

TEST_F(Ac3dTest, CountsAndIndicesThatLie) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = World(kTriangle);
    return text.replace(text.find(from), from.size(), to);
  };
  ExpectMessage(Load(with("numvert 3", "numvert 4000000000")), "bad.ac", "line 11",
                "3 finite numbers");
  ExpectMessage(Load(with("numvert 3", "numvert -3")), "bad.ac", "line 7", "numvert");
  ExpectMessage(Load(with("numsurf 1", "numsurf 4000000000")), "bad.ac", "expected SURF");
  ExpectMessage(Load(with("refs 3", "refs 4000000000")), "bad.ac", "line 18");
  ExpectMessage(Load(with("kids 1", "kids 4000000000") + "x"), "bad.ac", "child 1 of 4000000000");
  ExpectMessage(Load(with("2 0 1", "3 0 1")), "bad.ac", "line 17", "vertex 3");
  ExpectMessage(Load(with("mat 0", "mat 2")), "bad.ac", "material 2, but the file has 2");
  ExpectMessage(Load(with("1 0 0\n", "inf 0 0\n")), "bad.ac", "line 9");
  ExpectMessage(Load(with("AC3Db", "AC4Db")), "bad.ac", "AC3D");
}

// As files are that somebody has deleted objects from: what is there is read.
TEST_F(Ac3dTest, FewerChildrenThanPromised) {
  const auto loaded = Ok(
      LoadMesh(Write("a.ac", kHead + "OBJECT world\nkids 3\nOBJECT group\nkids 2\nOBJECT poly\n" +
                                 kTriangle + "kids 0\n")));
  EXPECT_EQ(loaded->mesh.faces.size(), 1u);
  ExpectOnly(loaded->warnings, "child 1 of 2");
}

TEST_F(Ac3dTest, NestedTooDeep) {
  std::string text = kHead;
  for (int i = 0; i < 200000; ++i) text += "OBJECT group\nkids 1\n";
  ExpectMessage(Load(text), "bad.ac", "line 518", "deep");
}

Bytes FileOf(std::string header, const std::string& runs) {
  header += "data\n" + runs;
  return {header.begin(), header.end()};
}

// A grid without symmetry: x, y and z are told apart.
BinvoxGrid Sample() {
  BinvoxGrid grid{4, {-0.25, -0.5, 0.125}, 0.75, std::vector<std::uint8_t>(64)};
  for (const std::size_t i : {0 * 16 + 0 * 4 + 1, 0 * 16 + 2 * 4 + 0, 3 * 16 + 0 * 4 + 0})
    grid.voxels[i] = 1;
  return grid;
}

// The format's own rule: index = x * side^2 + z * side + y.
TEST(Binvox, YIsFastestThenZ) {
  const std::string header = "#binvox 1\ndim 2 2 2\ntranslate -1 0 2.5\nscale 3\n";
  const auto grid = Ok(DecodeBinvox(FileOf(header, std::string("\0\1\1\1\0\4\1\1\0\1", 10)), "a"));
  // Voxels 1 and 6 of the file: (x, y, z) = (0, 1, 0) and (1, 0, 1).
  EXPECT_EQ(grid->voxels, (std::vector<std::uint8_t>{0, 0, 1, 0, 0, 1, 0, 0}));
  EXPECT_EQ(grid->translate, (std::array<double, 3>{-1, 0, 2.5}));
  EXPECT_EQ(grid->scale, 3);
}

TEST(Binvox, ComesBackAsItWasWritten) {
  const BinvoxGrid grid = Sample();
  const auto again = Ok(DecodeBinvox(EncodeBinvox(grid), "a"));
  EXPECT_EQ(again->voxels, grid.voxels);
  EXPECT_EQ(again->translate, grid.translate);
  EXPECT_EQ(again->scale, grid.scale);
  const BinvoxGrid full{32, {}, 1, std::vector<std::uint8_t>(32 * 32 * 32, 1)};  // runs of 255
  EXPECT_EQ(DecodeBinvox(EncodeBinvox(full), "a").value().voxels, full.voxels);
}

TEST(Binvox, RefusesWhatIsBroken) {
  const auto read = [](const Bytes& bytes) { return DecodeBinvox(bytes, "a.binvox").status(); };
  ExpectCutsRefused(EncodeBinvox(Sample()), "a.binvox: ", read);
  const std::string dim = "#binvox 1\ndim 2 2 2\n";
  const std::string eight("\0\10", 2);
  EXPECT_TRUE(read(FileOf(dim, eight)).ok());  // the lines of translate and scale may be missing
  ExpectMessage(read(FileOf(dim, eight + eight)), "more voxels");
  ExpectMessage(read(FileOf(dim, "\2\10")), "a voxel is 2");
  ExpectMessage(read(FileOf("#binvox 1\ndim 2 2 3\n", eight)), "line 2");
  ExpectMessage(read(FileOf("#binvox 1\ndim 2000 2000 2000\n", eight)), "up to 512");
  ExpectMessage(read(FileOf("#binvox 1\ndim 512 512 512\n", eight)), "ends before");
  ExpectMessage(read(FileOf(dim + "scale nan\n", eight)), "line 3");
  ExpectMessage(read(FileOf(dim + "scale 0\n", eight)), "line 3");
}

}  // namespace tilegrad::io::ac3d_binvox_test

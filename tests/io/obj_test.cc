// SPDX-License-Identifier: Apache-2.0
// OBJ and MTL: vertices, corners and materials as the file has them, and the ways to write them.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::obj_test {

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string kUvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

class ObjTest : public TempFolderTest {
 protected:
  // Without a warning unless `warnings` says how many.
  LoadedMesh Load(const std::string& text, std::size_t warnings = 0) {
    auto loaded = Ok(LoadMesh(Write("a.obj", text)));
    EXPECT_EQ(loaded->warnings.size(), warnings)
        << (loaded->warnings.empty() ? "none" : loaded->warnings[0]);
    loaded->warnings.resize(std::max(loaded->warnings.size(), warnings));
    return std::move(*loaded);
  }
  Status LoadStatus(const std::string& text) { return LoadMesh(Write("a.obj", text)).status(); }
};

// The material of each face, by name.
std::vector<std::string> Names(const Mesh& mesh) {
  std::vector<std::string> names;
  for (const std::int32_t m : mesh.face_materials) names.push_back(mesh.materials[m].name);
  return names;
}

// --- vertices keep their numbers ---

TEST_F(ObjTest, InterleavedMaterialsDoNotTearTheMesh) {
  Write("m.mtl", "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n");
  const std::string square = "mtllib m.mtl\nv 9 9 9\nv 1 1 0\nv 0 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\n";
  const auto loaded = Load(
      square + "usemtl a\nf 3 5 2\nusemtl b\nf 3 2 4\nusemtl a\ng part\nf 2 5 3\no x\nf 6 4 3\n");
  const Mesh& mesh = loaded.mesh;
  // Number 0 is used by no face, 1 and 5 are at one place: all stay.
  EXPECT_EQ(mesh.positions, (std::vector<glm::vec3>{
                                {9, 9, 9}, {1, 1, 0}, {0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}}));
  EXPECT_EQ(mesh.faces, (std::vector<Face>{{2, 4, 1}, {2, 1, 3}, {1, 4, 2}, {5, 3, 2}}));
  EXPECT_EQ(Names(mesh), (std::vector<std::string>{"a", "b", "a", "a"}));
  EXPECT_EQ(mesh.materials.size(), 2u);
}

TEST_F(ObjTest, UvAndNormalsStayWithCornersAndKeepTheirIndices) {
  const auto loaded = Load(kSquare + kUvs + "vt 0.5 0.5\nvn 0 0 2\nvn 3 0 4\n" +
                           "f 1/1/1 2/2/2 3/3/1\nf 1//1 3/3 4\nf 1/-1/-2 3/-3/-1 4/-2/-2\n");
  const Mesh& mesh = loaded.mesh;
  EXPECT_EQ(mesh.positions.size(), 4u);
  EXPECT_EQ(mesh.corner_uvs,
            (std::vector<glm::vec2>{
                {0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 0}, {0.5f, 0.5f}, {1, 1}, {0, 1}}));
  EXPECT_EQ(mesh.corner_normals[1], glm::vec3(0.6f, 0, 0.8f));
  EXPECT_EQ(mesh.corner_normals[4], glm::vec3(0, 0, 1));  // the surface's: the file has none
  EXPECT_EQ(loaded.tables.uvs,
            (std::vector<glm::vec2>{{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5f, 0.5f}}));
  EXPECT_EQ(loaded.tables.normals, (std::vector<glm::vec3>{{0, 0, 2}, {3, 0, 4}}));
  EXPECT_EQ(loaded.tables.corner_uvs, (std::vector<std::int32_t>{0, 1, 2, -1, 2, -1, 4, 2, 3}));
  EXPECT_EQ(loaded.tables.corner_normals, (std::vector<std::int32_t>{0, 1, 0, 0, -1, -1, 0, 1, 0}));
}

TEST_F(ObjTest, PolygonsConcaveAndLarge) {
  // Corner 4 is a notch: its two neighbours may not be joined.
  const auto notch = Load("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv 0 -0.5 0\nv -1 1 0\nf 1 2 3 4 5\n");
  double area = 0;
  for (const auto& [a, b, c] : notch.mesh.faces) {
    const auto& p = notch.mesh.positions;
    const float twice = glm::cross(p[b] - p[a], p[c] - p[a]).z;
    EXPECT_GT(twice, 0);
    area += 0.5 * twice;
  }
  EXPECT_NEAR(area, 4 - 0.5 * 2 * 1.5, 1e-6);
  std::string circle, face = "f";
  for (int i = 0; i < 300; ++i) {
    circle += fmt::format("v {} {} 0\n", std::cos(i * 0.02094), std::sin(i * 0.02094));
    face += fmt::format(" {}", i + 1);
  }
  EXPECT_EQ(Load(circle + face + "\n").mesh.faces.size(), 298u);
}

// --- ways of writing ---

TEST_F(ObjTest, LinesAndIndicesOfEveryKind) {
  const std::vector<Face> want = {{0, 1, 2}, {0, 2, 3}};
  for (const std::string& text :
       {kSquare + "f 1 2 3 4\n", kSquare + "f 1 2 \\\n3 4",
        kSquare + "f 1 2 \\\r\n\\\r\n3 4 # end\n", "\xef\xbb\xbf" + kSquare + "f -4 -3 -2 -1\n",
        "f 1 2 3 4\n" + kSquare, "# C:\\models\\\n" + kSquare + "f 1// 2// 3// 4//\n",
        kSquare + "f 1 2 3 4\\", std::string("v 0 0 0\rv 1 0 0\rv 1 1 0\r\rv 0 1 0\rf 1 2 3 4\r"),
        std::string(
            "\tv\t0  0 0\n v 2 0 0 2 # w divides\nv 1 1 0 1\nv 0 +1.0e0 -0\n f 1 2 3 4\n")}) {
    const auto loaded = Load(text);
    EXPECT_EQ(loaded.mesh.faces, want) << text;
    EXPECT_EQ(loaded.mesh.positions,
              (std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}))
        << text;
  }
}

TEST_F(ObjTest, DamageNamesTheLine) {
  ExpectMessage(LoadStatus(kSquare + "vt nan 0\nf 1/1 2/1 3/1\n"), "a.obj", "line 5", "\"nan\"");
  ExpectMessage(LoadStatus(kSquare + "vn 0 0\nf 1//1 2//1 3//1\n"), "line 5", "normal");
  ExpectMessage(LoadStatus("v 1 2 3 0\nf 1 1 1\n"), "line 1", "vertex");  // w = 0
  ExpectMessage(LoadStatus("v 1 2 3 1 nan 0\nf 1 1 1\n"), "line 1", "\"nan\"");
  ExpectMessage(LoadStatus(kSquare + "f 1/2/3/4 2 3\n"), "line 5", "is not a corner");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 2147483648\n"), "line 5", "vertex 2147483648");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 -9223372036854775808\n"), "line 5");
  ExpectMessage(LoadStatus("\xff\xfev"), "a.obj", "UTF-16");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 9\n"), "line 5", "vertex 9");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 -9\n"), "line 5", "-9");
  ExpectMessage(LoadStatus(kSquare + "f 1/5 2/5 3/5\n"), "line 5", "texture coordinate 5");
  ExpectMessage(LoadStatus(kSquare + "f 0 1 2\n"), "line 5", "vertex 0");
  ExpectMessage(LoadStatus(kSquare + "f a b c\n"), "line 5", "\"a\"");
  ExpectMessage(LoadStatus("v 0 0\nf 1 1 1\n"), "line 1", "three finite numbers");
  ExpectMessage(LoadStatus("v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "a.obj");
  ExpectMessage(LoadStatus("v 0 0 0\nv 1 0 0\n"), "a.obj");  // points alone
  ExpectMessage(LoadStatus("v 0 0 0\nv 1 zero 0\n"), "line 2", "\"zero\"");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 \\\n 9\n"), "line 6", "vertex 9");
  ExpectMessage(LoadStatus(kSquare + "f 1 2 3\nl 1 77\n"), "line 6", "vertex 77");
  ExpectMessage(LoadStatus(kSquare + "f 1 1 99999999999999999999\n"), "line 5");
  ExpectMessage(LoadMesh(Write("upper.OBJ", "v 0 0 0\nf 1 2 3\n")).status(), "upper.OBJ", "line 2");
}

TEST_F(ObjTest, WhatIsNotReadIsAWarning) {
  const std::string faces = kSquare + "f 1 2 3\n";
  ExpectIn(Load(faces + "f 1 2\nf 3\n", 1).warnings[0], "2 faces");
  ExpectIn(Load(faces + "p 1\nl 1 2\n", 1).warnings[0], "points or lines");
  ExpectIn(Load(faces + "cstype bezier\ncurv 0 1 1 2\nend\n", 1).warnings[0],
           "\"cstype\", \"curv\", \"end\"");
  ExpectIn(Load(faces + "#MRGB ffff0000ffff0000ffff0000ffff0000\n", 1).warnings[0], "#MRGB");
  ExpectIn(Load("v 5 5 5 1 1\n" + faces, 1).warnings[0],
           "vertices with 5 or more than 7 numbers, of which 3 or 7 are read: 1");
  Load(faces + "s off\ng x\no y\nvp 0.1\nlod 3\n");
}

// --- colours ---

TEST_F(ObjTest, VertexColors) {
  const auto all = Load("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5 0.25\nf 1 2 3\n", 1).mesh;
  EXPECT_EQ(all.colors, (std::vector<glm::vec4>{{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 0.5f, 0.25f}}));
  EXPECT_EQ(all.materials.at(0).base_color, glm::vec4(1));
  for (const std::string text :  // each its own, the others white, wherever they stand
       {"v 0 0 0\nv 1 0 0 0 0 1\nv 0 1 0\nf 1 2 3\n",
        "f 1 2 3\nv 0 0 0 1\nv 1 0 0 0 0 1\nv 0 1 0\n"}) {
    EXPECT_EQ(Load(text).mesh.colors,
              (std::vector<glm::vec4>{{1, 1, 1, 1}, {0, 0, 1, 1}, {1, 1, 1, 1}}));
  }
  const auto bytes = Load("v 0 0 0 255 0 51\nv 1 0 0 0 255 0\nv 0 1 0\nf 1 2 3\n", 1);
  ExpectIn(bytes.warnings[0], "0 to 255");
  EXPECT_EQ(bytes.mesh.colors[0], glm::vec4(1, 0, 0.2f, 1));
  Write("m.mtl", "newmtl m\nKd 0.5 0.25 1\n");
  const auto both = Load("mtllib m.mtl\nusemtl m\n" + kSquare + "v 0 0 1 0 1 0\nf 1 2 5\n").mesh;
  EXPECT_EQ(both.colors[4], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(both.materials.at(0).base_color, glm::vec4(0.5f, 0.25f, 1, 1));
}

TEST_F(ObjTest, WhiteWhereNoMaterialIsNamed) {
  Write("m.mtl", "newmtl m\nKs 1 1 1\nnewmtl d\nd 0.5\nnewmtl grey\nKd 0.25\n");
  const auto loaded =
      Load("mtllib m.mtl\n" + kSquare +
               "f 1 2 3\nusemtl m\nf 1 3 4\nusemtl d\nf 1 2 4\nusemtl grey\nf 2 3 4\n",
           1);
  EXPECT_EQ(loaded.warnings[0],
            "faces before the first usemtl are white; the library has \"d\", \"grey\", \"m\"");
  const Mesh& mesh = loaded.mesh;
  ASSERT_EQ(mesh.materials.size(), 4u);
  EXPECT_EQ(mesh.materials[0].base_color, glm::vec4(1));
  EXPECT_EQ(mesh.materials[1].base_color, glm::vec4(1));
  EXPECT_EQ(mesh.materials[2].base_color, glm::vec4(1, 1, 1, 0.5f));
  EXPECT_EQ(mesh.materials[3].base_color, glm::vec4(0.25f, 0.25f, 0.25f, 1));
}

TEST_F(ObjTest, LibrariesThatNobodyUses) {
  ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok());
  const std::string square = "mtllib m.mtl\n" + kSquare + kUvs + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
  Write("m.mtl", "newmtl skin\nmap_Kd q.png\n");
  const auto one = Load(square, 1);  // there is no choice
  ExpectIn(one.warnings[0], "no usemtl in the file: drawn with \"skin\"");
  EXPECT_EQ(Names(one.mesh), (std::vector<std::string>{"skin", "skin"}));
  EXPECT_EQ(one.mesh.materials.at(0).base_color_texture, 0);
  Write("m.mtl", "newmtl skin\nmap_Kd q.png\nnewmtl eye\nKd 0 0 1\n");
  const auto two = Load(square, 1);
  ExpectIn(two.warnings[0], "white; the library has \"eye\", \"skin\"");
  EXPECT_EQ(two.mesh.materials.at(0).base_color, glm::vec4(1));
  EXPECT_TRUE(two.mesh.textures.empty());
  const auto some = Load(square + "usemtl eye\nf 1/1 2/2 4/4\n", 1);
  EXPECT_EQ(Names(some.mesh), (std::vector<std::string>{"", "", "eye"}));
  Write("m.mtl", "# nothing\n");
  Load(square);
}

// Files of one name in several folders, and names that differ in upper and lower case.
TEST_F(ObjTest, ImagesAreToldApartByTheirFiles) {
  for (const auto& [name, grey] : std::vector<std::pair<std::string, int>>{
           {"q.png", 10}, {"Q.png", 20}, {"sub/q.png", 30}, {"sub/only.png", 40}}) {
    ASSERT_TRUE(SavePng(folder_ / name, ImageU8(1, 1, 3, static_cast<std::uint8_t>(grey))).ok());
  }
  const std::vector<std::pair<std::string, int>> images = {
      {"q.png", 10},      {"Q.png", 20},        {"sub/q.png", 30},        {"./q.png", 10},
      {"sub\\q.png", 30}, {"C:\\x\\q.png", 10}, {"-s 2 2 sub/q.png", 30}, {"sub/ONLY.png", 40}};
  std::string mtl, obj = "mtllib m.mtl\n" + kSquare + kUvs;
  for (std::size_t i = 0; i < images.size(); ++i) {
    mtl += fmt::format("newmtl {}\nmap_Kd {}\n", i, images[i].first);
    obj += fmt::format("usemtl {}\nf 1/1 2/2 3/3\n", i);
  }
  Write("m.mtl", mtl);
  const Mesh mesh = Load(obj).mesh;
  ASSERT_EQ(mesh.materials.size(), images.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    const int texture = mesh.materials[i].base_color_texture;
    ASSERT_GE(texture, 0);
    EXPECT_EQ(mesh.textures[texture].image.pixels[0], images[i].second) << images[i].first;
  }
  EXPECT_EQ(mesh.textures.size(), 4u);
}

TEST_F(ObjTest, NormalsThatAreNoneAreTheSurfaces) {
  for (const std::string none : {"nan", "inf", "-1.#IND", "1e300"}) {
    const auto loaded = Load(kSquare + "vn 0 0 2\nvn " + none + " 0 1\nf 1//1 2//2 3//1\n", 1);
    ExpectIn(loaded.warnings[0], "normals that are not finite");
    EXPECT_EQ(loaded.mesh.corner_normals, std::vector<glm::vec3>(3, {0, 0, 1}));
    EXPECT_EQ(loaded.tables.normals, (std::vector<glm::vec3>{{0, 0, 2}, {0, 0, 0}}));
  }
}

// --- material libraries ---

TEST_F(ObjTest, LibrariesByEveryName) {
  const std::string a = "newmtl a\nKd 1 0 0\n", b = "newmtl b\nKd 0 0 1\n";
  Write("a.mtl", a);
  Write("b.mtl", "\xef\xbb\xbf" + b);
  Write("my lib.mtl", a + b);
  Write("sub/c.mtl", a + b);
  for (const std::string libraries :
       {"mtllib a.mtl b.mtl", "mtllib a.mtl\nmtllib b.mtl", "mtllib my lib.mtl",
        "mtllib \"my lib.mtl\"", "mtllib a.mtl my lib.mtl", "mtllib b.mtl \"a.mtl\"",
        "mtllib ./a.mtl B.MTL", "mtllib sub\\c.mtl", "mtllib C:\\else where\\my lib.mtl",
        "mtllib a.mtl \\\n b.mtl"}) {
    const auto mesh =
        Load(libraries + "\n" + kSquare + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n").mesh;
    ASSERT_EQ(mesh.materials.size(), 2u);
    EXPECT_EQ(mesh.materials[0].base_color, glm::vec4(1, 0, 0, 1)) << libraries;
    EXPECT_EQ(mesh.materials[1].base_color, glm::vec4(0, 0, 1, 1)) << libraries;
  }
}

TEST_F(ObjTest, MissingLibrariesAndUnknownMaterials) {
  Write("b.mtl", "newmtl b\nKd 0 0 1\n");
  const std::string square = kSquare + "usemtl b\nf 1 2 3\n";
  const auto missing = Load("mtllib no where.mtl\n" + square, 2);
  ExpectIn(missing.warnings[0], "\"no where.mtl\" not found");
  ExpectIn(missing.warnings[1], "\"b\"");
  EXPECT_EQ(missing.mesh.materials.at(0).base_color, glm::vec4(1));
  ExpectIn(Load("mtllib b.mtl lost.mtl\n" + square, 1).warnings[0], "\"lost.mtl\" not found");
  const auto unknown =
      Load("mtllib b.mtl\n" + square + "usemtl z\nf 1 3 4\nusemtl y\nf 1 2 4\n", 1);
  ExpectIn(unknown.warnings[0], "\"y\", \"z\"");
  EXPECT_EQ(Names(unknown.mesh), (std::vector<std::string>{"b", "z", "y"}));
  Write("a.mtl", "newmtl b\nKd 0 1 0\n");  // the mesh's own name
  const auto renamed = Load("mtllib old.mtl\n" + square, 1);
  ExpectIn(renamed.warnings[0], "a.mtl is read instead");
  EXPECT_EQ(renamed.mesh.materials.at(0).base_color, glm::vec4(0, 1, 0, 1));
}

TEST_F(ObjTest, NamesOfMaterials) {
  Write("m.mtl",
        "newmtl Material #25\nKd 1 0 0\nnewmtl \"in quotes\"\nKd 0 1 0\nnewmtl\tx\nKd 0 0 1\n");
  const auto mesh = Load("mtllib m.mtl\n" + kSquare +
                         "usemtl Material #25 \nf 1 2 3\nusemtl in quotes\nf 1 2 3\n"
                         "usemtl x # a comment\nf 1 2 3\n")
                        .mesh;
  ASSERT_EQ(mesh.materials.size(), 3u);
  for (int c = 0; c < 3; ++c)
    EXPECT_EQ(mesh.materials[static_cast<std::size_t>(c)].base_color[c], 1);
  Write("m.mtl", "newmtl y # shiny\nKd 1 0 0\nnewmtl Material #25\nKd 0 1 0\n");
  const auto noted = Load("mtllib m.mtl\n" + kSquare +
                              "usemtl y\nf 1 2 3\nusemtl Material #26\nf 1 2 3\nusemtl "
                              "Material\nf 1 2 3\n",
                          1);
  EXPECT_EQ(noted.mesh.materials.at(0).base_color, glm::vec4(1, 0, 0, 1));
  ExpectIn(noted.warnings[0], "no material library defines \"Material\", \"Material #26\": white");
  Write("m.mtl", "newmtl a\nKd 1 0 0\nnewmtl a\nKd 0 1 0\n");
  const auto twice = Load("mtllib m.mtl\n" + kSquare + "usemtl a\nf 1 2 3\n", 1);
  ExpectIn(twice.warnings[0], "\"a\" is defined more than once");
  EXPECT_EQ(twice.mesh.materials.at(0).base_color, glm::vec4(0, 1, 0, 1));
}

TEST_F(ObjTest, OpacityAndDamageInLibraries) {
  const auto material = [&](const std::string& text, std::size_t warnings = 0) {
    Write("m.mtl", "newmtl m\n" + text);
    return Load("mtllib m.mtl\nusemtl m\n" + kSquare + "f 1 2 3\n", warnings);
  };
  EXPECT_EQ(material("d 0.25\n").mesh.materials.at(0).base_color.a, 0.25f);
  EXPECT_EQ(material("Tr 0.75\n").mesh.materials.at(0).base_color.a, 0.25f);
  EXPECT_EQ(material("d 1\nTr 1\n").mesh.materials.at(0).base_color.a, 1);
  EXPECT_EQ(material("Tr 1\nd 1\n").mesh.materials.at(0).base_color.a, 1);
  ExpectIn(material("d -halo 0.5\nmap_d x.png\nKe 0 0 1\nmap_Bump y.png\n", 1).warnings[0],
           "\"d -halo\", \"ke\", \"map_bump\", \"map_d\"");
  material("Ke 0 0 0\nKa 1 1 1\nKs 0 0 0\nNs 10\nillum 2\nNi 1.5\n");
  for (const std::string bad : {"Kd nan 0 0\n", "Kd 0 inf 0\n", "Kd 0 0 1e39\n", "Kd 1 2\n", "Kd\n",
                                "d x\n", "d nan\n", "d -nan\n", "Tr inf\n"}) {
    Write("m.mtl", "newmtl m\n" + bad);
    ExpectMessage(LoadStatus("mtllib m.mtl\nusemtl m\n" + kSquare + "f 1 2 3\n"), "m.mtl", "line 2",
                  "finite");
  }
}

// --- images ---

TEST_F(ObjTest, OptionsOfImages) {
  ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok());
  ASSERT_TRUE(SavePng(folder_ / "my -tex.png", ImageU8(2, 2, 3, 88)).ok());
  ASSERT_TRUE(SavePng(folder_ / "sub" / "q.png", ImageU8(2, 2, 3, 77)).ok());
  struct Case {
    std::string line;
    glm::vec2 uv;  // of the corner whose file's uv is (1, 1)
    TextureWrap wrap = TextureWrap::kRepeat;
  };
  for (const Case& c : std::vector<Case>{
           {"q.png", {1, 1}},
           {"-s 2 4 1 q.png", {2, 4}},
           {"-s 2 4 q.png", {2, 4}},
           {"-s 3 q.png", {3, 1}},
           {"-o 0.25 0.5 0 q.png", {1.25f, 1.5f}},
           {"-o 0.25 0.5 my -tex.png", {1.25f, 1.5f}},
           {"-o 0 -7 0 -s 1 10 1 -clamp on q.png", {1, 3}, TextureWrap::kClamp},
           {"-clamp on my -tex.png", {1, 1}, TextureWrap::kClamp},
           {"-clamp off -blendu on -blendv off -texres 4 -boost 2 \"my -tex.png\"", {1, 1}},
           {"sub\\q.png", {1, 1}},
           {"q.png # the image", {1, 1}},
           {"-s 2 2 1 my -tex.png\t# the image", {2, 2}},
           {"D:\\old\\my -tex.png", {1, 1}}}) {
    SCOPED_TRACE(c.line);
    Write("m.mtl", "newmtl m\nKd 0 0 0\nmap_Kd " + c.line + "\n");
    const auto loaded = Load("mtllib m.mtl\nusemtl m\n" + kSquare + kUvs + "f 1/1 2/2 3/3 4/4\n");
    EXPECT_EQ(loaded.mesh.textures.size(), 1u);
    EXPECT_EQ(loaded.mesh.corner_uvs[2], c.uv);
    EXPECT_EQ(loaded.mesh.materials.at(0).wrap, (std::array{c.wrap, c.wrap}));
    EXPECT_EQ(loaded.mesh.materials.at(0).base_color, glm::vec4(1));
    EXPECT_EQ(loaded.tables.uvs[2], glm::vec2(1, 1));  // as the file has it
  }
  Write("m.mtl", "newmtl m\nmap_Kd -mm 0.1 2 -imfchan r -t 1 1 q.png\n");
  ExpectIn(Load("mtllib m.mtl\nusemtl m\n" + kSquare + kUvs + "f 1/1 2/2 3/3\n", 1).warnings[0],
           "\"map_Kd -imfchan\", \"map_Kd -mm\", \"map_Kd -t\"");
}

// Two materials of one image at different scales: each face has its own.
TEST_F(ObjTest, ScalesAreOfMaterials) {
  ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok());
  Write("m.mtl", "newmtl a\nmap_Kd -s 2 2 q.png\nnewmtl b\nmap_Kd -o 5 0 q.png\n");
  const auto mesh =
      Load("mtllib m.mtl\n" + kSquare + kUvs + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/4\n")
          .mesh;
  EXPECT_EQ(mesh.textures.size(), 1u);
  EXPECT_EQ(mesh.corner_uvs,
            (std::vector<glm::vec2>{{0, 0}, {2, 0}, {2, 2}, {5, 0}, {6, 1}, {5, 1}}));
}

TEST_F(ObjTest, ImagesWithoutCoordinates) {
  ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok());
  Write("m.mtl", "newmtl m\nKd 0 1 0\nmap_Kd q.png\n");
  const auto none = Load("mtllib m.mtl\nusemtl m\n" + kSquare + "f 1 2 3\n", 1);
  ExpectIn(none.warnings[0], "no texture coordinates");
  EXPECT_EQ(none.mesh.materials.at(0).base_color, glm::vec4(0, 1, 0, 1));
  const auto some = Load("mtllib m.mtl\nusemtl m\n" + kSquare + kUvs + "f 1 2/2 3/3\n", 1);
  ExpectIn(some.warnings[0], "(0, 0)");
  Write("m.mtl", "newmtl m\nKd 0 1 0\nmap_Kd lost.png\n");
  const auto lost = Load("mtllib m.mtl\nusemtl m\n" + kSquare + kUvs + "f 1/1 2/2 3/3\n", 1);
  ExpectIn(lost.warnings[0], "lost.png");
  EXPECT_EQ(lost.mesh.materials.at(0).base_color, glm::vec4(0, 1, 0, 1));
}

}  // namespace tilegrad::io::obj_test

// SPDX-License-Identifier: Apache-2.0
// PLY and OFF: every encoding and variant that is read, and broken files.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::ply_off_test {

// A text file's header, `extra` lines in it, up to the first properties of its vertices.
std::string Vertices(int count, const std::string& extra = "") {
  return "ply\nformat ascii 1.0\n" + extra + "element vertex " + std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\n";
}

class PlyOffTest : public TempFolderTest {
 protected:
  Status LoadPly(const std::string& text) { return LoadMesh(Write("bad.ply", text)).status(); }
  Status LoadOff(const std::string& text) { return LoadMesh(Write("bad.off", text)).status(); }
};

std::string Header(const std::string& format, const std::string& faces = "1") {
  return "ply\nformat " + format +
         " 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
         "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
         "property list uchar short neighbours\nelement face " +
         faces + "\nproperty list uchar int vertex_indices\nend_header\n";
}

const std::string kTextBody =
    "0 0 0.5 255 0 0 0\n1 0 0.5 0 255 0 2 7 8\n1 1 0.5 0 0 255 0\n0 1 0.5 51 51 51 0\n4 0 1 2 3\n";

// The same numbers as kTextBody.
std::string BinaryBody(bool big_endian) {
  std::string out;
  const auto add = [&](auto value) {
    char bytes[sizeof(value)];
    std::memcpy(bytes, &value, sizeof(value));
    if (big_endian) std::reverse(bytes, bytes + sizeof(value));
    out.append(bytes, sizeof(value));
  };
  const float xy[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const std::uint8_t rgb[4][3] = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {51, 51, 51}};
  for (int i = 0; i < 4; ++i) {
    add(xy[i][0]);
    add(xy[i][1]);
    add(0.5);
    for (const std::uint8_t c : rgb[i]) add(c);
    add(std::uint8_t(i == 1 ? 2 : 0));
    if (i == 1) {
      add(std::int16_t{7});
      add(std::int16_t{8});
    }
  }
  add(std::uint8_t{4});
  for (std::int32_t i = 0; i < 4; ++i) add(i);
  return out;
}

TEST_F(PlyOffTest, PlyOfEveryEncodingIsTheSame) {
  for (const std::string& text :
       {Header("ascii") + kTextBody, Header("binary_little_endian") + BinaryBody(false),
        Header("binary_big_endian") + BinaryBody(true)}) {
    const auto loaded = Ok(LoadMesh(Write("a.ply", text)));
    EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(loaded->mesh.positions[2], glm::vec3(1, 1, 0.5f));
    EXPECT_EQ(loaded->mesh.colors[1], glm::vec4(0, 1, 0, 1));
    EXPECT_EQ(loaded->mesh.colors[3], glm::vec4(0.2f, 0.2f, 0.2f, 1));
    ExpectCutsRefused(Bytes(text.begin(), text.end() - 2), "bad.ply", [&](const Bytes& cut) {
      return LoadPly({cut.begin(), cut.end()});
    });
  }
}

TEST_F(PlyOffTest, PlyWithATexture) {
  ASSERT_TRUE(SavePng(folder_ / "my wood.png", ImageU8(2, 2, 3, 77)).ok());
  const std::string vertices = Vertices(3, "comment texturefile my wood.png\n");
  const std::string by_vertex = vertices +
                                "property float s\nproperty float t\nelement face 1\nproperty list "
                                "uchar int vertex_index\nend_header\n"
                                "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0.25 1\n3 0 1 2\n";
  const std::string by_corner = vertices +
                                "element face 1\nproperty list uchar int vertex_indices\n"
                                "property list uchar float texcoord\nend_header\n"
                                "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0.25 1\n";
  for (const std::string& text : {by_vertex, by_corner}) {
    const auto loaded = Ok(LoadMesh(Write("a.ply", text)));
    EXPECT_EQ(loaded->mesh.corner_uvs, (std::vector<glm::vec2>{{0, 0}, {1, 0}, {0.25f, 1}}));
    ASSERT_EQ(loaded->mesh.textures.size(), 1u);
    EXPECT_EQ(loaded->mesh.materials.at(0).base_color_texture, 0);
  }
}

TEST_F(PlyOffTest, PlyWithLyingNumbers) {
  ExpectMessage(LoadPly(Header("ascii", "4000000000") + kTextBody), "bad.ply",
                "declares 4000000000 \"face\"");
  ExpectMessage(LoadPly(Header("ascii", "99999999999999999999") + kTextBody), "bad.ply", "line 12",
                "element face");
  ExpectMessage(LoadPly(Header("ascii", "-1") + kTextBody), "bad.ply", "line 12");
  std::string body = kTextBody;
  body.back() = '9';
  ExpectMessage(LoadPly(Header("ascii") + body.replace(body.rfind("3"), 2, "4 ")), "bad.ply",
                "face 0 uses vertex 4, but the file has 4");
  std::string binary = BinaryBody(false);
  binary[binary.size() - 17] = '\xff';  // corners of the face
  ExpectMessage(LoadPly(Header("binary_little_endian") + binary), "bad.ply", "face 0",
                "vertex_indices");
  binary = BinaryBody(false);
  binary[binary.size() - 1] = '\xff';  // a negative index
  ExpectMessage(LoadPly(Header("binary_little_endian") + binary), "bad.ply", "face 0 uses");
  binary = BinaryBody(false);
  std::memset(&binary[0], 0xff, 4);  // NaN
  ExpectMessage(LoadPly(Header("binary_little_endian") + binary), "bad.ply", "vertex 0", "\"x\"");
}

TEST_F(PlyOffTest, PlyHeadersThatMakeNoSense) {
  ExpectMessage(LoadPly("plx\n"), "bad.ply", "\"ply\"");
  ExpectMessage(LoadPly("ply\nformat martian 1.0\nend_header\n"), "bad.ply", "line 2");
  ExpectMessage(LoadPly("ply\nproperty float x\nend_header\n"), "bad.ply", "line 2");
  ExpectMessage(LoadPly("ply\nelement vertex 1\nproperty list float int x\nend_header\n1\n"),
                "bad.ply", "line 3");
  ExpectMessage(LoadPly("ply\nelement nothing 1000000000\nend_header\n"), "bad.ply", "nothing");
  ExpectMessage(LoadPly("ply\nelement vertex 1\nproperty float x\nend_header\n1\n"), "bad.ply",
                "no x, y and z");
}

TEST_F(PlyOffTest, OffAndItsVariants) {
  const std::string body = "0 0 0\n1 0 0 # a comment\n\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n";
  for (const std::string head :
       {"OFF\n4 1 0\n", "OFF 4 1 0\n", "OFF4 1 0\r\n", "# x\nOFF\n\n4 1 4\n"}) {
    const auto loaded = Ok(LoadMesh(Write("a.off", head + body)));
    EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
  }
  const auto colors = Ok(LoadMesh(Write(
      "c.off", "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0.5 0.25 1.0\n0 1 0 0 0 51\n3 0 1 2\n")));
  EXPECT_EQ(colors->mesh.colors,
            (std::vector<glm::vec4>{{1, 0, 0, 1}, {0.5f, 0.25f, 1, 1}, {0, 0, 0.2f, 1}}));
}

TEST_F(PlyOffTest, BrokenOff) {
  ExpectMessage(LoadOff(""), "bad.off", "empty");
  ExpectMessage(LoadOff("OFF BINARY\n1 1 1\n"), "bad.off", "line 1");
  ExpectMessage(LoadOff("NOFF\n1 1 1\n"), "bad.off", "line 1");
  ExpectMessage(LoadOff("OFF\n4000000000 1 0\n0 0 0\n"), "bad.off", "line 2", "can hold");
  ExpectMessage(LoadOff("OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n"), "bad.off", "line 5");
  ExpectMessage(LoadOff("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), "bad.off", "line 6",
                "vertex 3");
  ExpectMessage(LoadOff("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n99999999 0 1 2\n"), "bad.off", "line 6");
  ExpectMessage(LoadOff("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n"), "bad.off", "face 0");
}

// --- colours of faces, several textures, strips ---

std::string Square(const std::string& extra, const std::string& faces, const std::string& body) {
  return Vertices(5, extra) + faces + "end_header\n9 9 9\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + body;
}

const glm::vec4 kRed(1, 0, 0, 1), kGreen(0, 1, 0, 1), kBlue(0, 0, 1, 1), kWhite(1);

// Of each face, by its first corner.
std::vector<glm::vec4> FaceColors(const Mesh& mesh) {
  std::vector<glm::vec4> colors;
  for (std::size_t c = 0; c < mesh.corner_colors.size(); ++c) {
    if (c % 3 == 0) colors.push_back(mesh.corner_colors[c]);
    EXPECT_EQ(mesh.corner_colors[c], colors.back());
  }
  return colors;
}

TEST_F(PlyOffTest, PlyColorsOfFaces) {
  const std::string list = "property list uchar int vertex_indices\n";
  const std::string before = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const auto& [header, body] :
       {std::pair("element face 2\n" + list + before + "property uchar alpha\n",
                  std::string("4 1 2 3 4 255 0 0 255\n3 1 3 4 0 0 255 51\n")),
        std::pair("element face 2\n" + before + list,
                  std::string("255 0 0 4 1 2 3 4\n0 0 255 3 1 3 4\n"))}) {
    const auto loaded = Ok(LoadMesh(Write("a.ply", Square("", header, body))));
    EXPECT_EQ(loaded->mesh.positions.size(), 5u);  // none doubled, the unused one stays
    EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{1, 2, 3}, {1, 3, 4}, {1, 3, 4}}));
    const auto colors = FaceColors(loaded->mesh);
    const float alpha = header.find("alpha") == std::string::npos ? 1 : 0.2f;
    EXPECT_EQ(colors, (std::vector<glm::vec4>{kRed, kRed, {0, 0, 1, alpha}}));
    EXPECT_EQ(loaded->warnings.size(), alpha < 1 ? 1u : 0u);  // of alpha that is not drawn
  }
  std::string both = Header("ascii") + kTextBody;
  both.replace(both.find("end_header"), 0,
               "property uchar red\nproperty uchar green\nproperty uchar blue\n");
  both.replace(both.rfind("\n"), 0, " 1 2 3");
  const auto loaded = Ok(LoadMesh(Write("b.ply", both)));
  EXPECT_TRUE(loaded->mesh.corner_colors.empty());
  EXPECT_EQ(loaded->mesh.colors[1], kGreen);
  ASSERT_EQ(loaded->warnings.size(), 2u);
  ExpectIn(loaded->warnings[0], "colours of faces left out");
  ExpectIn(loaded->warnings[1], "left out: \"neighbours\"");
}

TEST_F(PlyOffTest, PlyWithSeveralTextures) {
  for (const char* name : {"a.png", "b.png"})
    ASSERT_TRUE(SavePng(folder_ / name, ImageU8(2, 2, 3, 77)).ok());
  const std::string textures = "comment TextureFile a.png\ncomment TextureFile b.png\n";
  const std::string faces =
      "element face 4\nproperty list uchar int vertex_indices\nproperty list uchar float "
      "texcoord\n";
  const std::string uv = " 6 0 0 1 0 1 1 ";
  const auto loaded =
      Ok(LoadMesh(Write("a.ply", Square(textures, faces + "property int texnumber\n",
                                        "3 1 2 3" + uv + "1\n3 1 3 4" + uv + "0\n3 1 2 4" + uv +
                                            "1\n3 2 3 4" + uv + "7\n"))));
  const Mesh& mesh = loaded->mesh;
  ASSERT_EQ(mesh.materials.size(), 3u);
  std::vector<std::string> names;
  for (const std::int32_t m : mesh.face_materials) names.push_back(mesh.materials[m].name);
  EXPECT_EQ(names, (std::vector<std::string>{"b.png", "a.png", "b.png", ""}));
  EXPECT_EQ(mesh.materials[mesh.face_materials[3]].base_color_texture, -1);
  ExpectOnly(loaded->warnings, "texnumber 7");
  // Without texnumber the first one is everybody's; without uv there is none.
  const auto first = Ok(LoadMesh(Write(
      "b.ply", Square(textures, faces, "3 1 2 3" + uv + "\n3 1 3 4 0\n3 1 2 4 0\n3 2 3 4 0\n"))));
  EXPECT_EQ(first->mesh.materials.size(), 1u);
  EXPECT_EQ(first->warnings.size(), 1u);
  const auto none = Ok(LoadMesh(Write(
      "c.ply",
      Square(textures, "element face 1\nproperty list uchar int vertex_indices\n", "3 1 2 3\n"))));
  EXPECT_TRUE(none->mesh.materials.empty());
  EXPECT_EQ(none->warnings.size(), 1u);
}

TEST_F(PlyOffTest, PlyStrips) {
  const std::string strips = "element tristrips 1\nproperty list int int vertex_indices\n";
  const auto loaded =
      Ok(LoadMesh(Write("a.ply", Square("", strips, "12 1 2 4 3 -1 1 2 2 3 4 -1 3\n"))));
  EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{1, 2, 4}, {4, 2, 3}, {2, 3, 4}}));
  EXPECT_EQ(loaded->mesh.positions.size(), 5u);
  ExpectMessage(LoadPly(Square("", strips, "3 1 2 5\n")), "tristrips 0 uses vertex 5");
  ExpectMessage(LoadPly(Square("", strips, "3 1 2 -2\n")), "tristrips 0 uses vertex -2");
}

// Faces before the vertices that they use.
TEST_F(PlyOffTest, PlyElementsInAnyOrder) {
  const std::string text =
      Vertices(4,
               "element face 1\nproperty list uchar int vertex_indices\nelement edge 1\n"
               "property int a\n") +
      "end_header\n4 0 1 2 3\n7\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  const auto loaded = Ok(LoadMesh(Write("a.ply", text)));
  EXPECT_EQ(loaded->mesh.faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
  ExpectOnly(loaded->warnings, "\"edge\"");
}

TEST_F(PlyOffTest, PlyPropertiesThatAreNotReadAreSaid) {
  const std::string text =
      Vertices(3) +
      "property float quality\nproperty float f_dc_0\nproperty list uchar int ring\nelement "
      "face 1\nproperty list uchar int vertex_index\nproperty int flags\nend_header\n"
      "0 0 0 1 1 0\n1 0 0 1 1 0\n0 1 0 1 1 1 2\n3 0 1 2 0\n";
  const auto loaded = Ok(LoadMesh(Write("a.ply", text)));
  ASSERT_EQ(loaded->warnings.size(), 1u);
  EXPECT_EQ(loaded->warnings[0],
            "properties left out: \"f_dc_0\", \"flags\", \"quality\", \"ring\"");
}

// --- numbers that are none ---

// Wherever nobody reads them.
TEST_F(PlyOffTest, PlyNumbersThatNobodyReadsMayBeAnything) {
  const std::string vertices = Vertices(3);
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
  for (const std::string none : {"nan", "-nan", "NaN", "inf", "-inf", "Infinity", "-nan(ind)",
                                 "1.#QNAN", "-1.#IND00", "1.#INF", "1e999", "n/a"}) {
    for (const std::string& text :
         {vertices + "property float quality\n" + faces + "end_header\n0 0 0 " + none +
              "\n1 0 0 0.5\n0 1 0 " + none + "\n3 0 1 2\n",
          vertices + faces + "property double quality\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 " +
              none + "\n",
          vertices + "property list uchar float ring\n" + faces + "end_header\n0 0 0 0\n1 0 0 2 " +
              none + " 1\n0 1 0 0\n3 0 1 2\n",
          "ply\nformat ascii 1.0\nelement sensor 2\nproperty float gain\n" +
              vertices.substr(vertices.find("element")) + faces + "end_header\n" + none + "\n" +
              none + "\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
          // A normal, a colour and a uv without all of their numbers are none.
          vertices + "property float nx\nproperty float red\nproperty float s\nproperty float a\n" +
              faces + "end_header\n0 0 0 " + none + " " + none + " " + none + " " + none +
              "\n1 0 0 0 0 0 0\n0 1 0 0 0 0 0\n3 0 1 2\n"}) {
      const auto loaded = LoadMesh(Write("a.ply", text));
      ASSERT_TRUE(loaded.ok()) << none << ": " << loaded.status().message();
      EXPECT_EQ(loaded->mesh.positions, (std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
      EXPECT_EQ(loaded->warnings.size(), 1u);
      EXPECT_TRUE(loaded->mesh.colors.empty() && loaded->mesh.normals.empty());
    }
  }
}

TEST_F(PlyOffTest, PlyBinaryNumbersThatNobodyReadsMayBeAnything) {
  for (const bool big_endian : {false, true}) {
    std::string header = Header(big_endian ? "binary_big_endian" : "binary_little_endian"), body;
    header.replace(header.find("property list"), 37, "property float quality\n");
    const std::string one = BinaryBody(big_endian);
    for (std::size_t v = 0, at = 0; v < 4; ++v) {
      body += one.substr(at, 19) + std::string("\x7f\xff\xff\x7f", 4);  // NaN in both orders
      at += v == 1 ? 24 : 20;
    }
    body += one.substr(one.size() - 17);
    const auto loaded = Ok(LoadMesh(Write("a.ply", header + body)));
    EXPECT_EQ(loaded->mesh.positions[2], glm::vec3(1, 1, 0.5f));
    EXPECT_EQ(loaded->mesh.colors[1], kGreen);
    ASSERT_EQ(loaded->warnings.size(), 1u);
    EXPECT_EQ(loaded->warnings[0], "properties left out: \"quality\"");
  }
}

// Normals follow from the surface; what does not is an error that names the place.
TEST_F(PlyOffTest, PlyNumbersThatAreRead) {
  const auto text = [](const std::string& vertex) {
    return Vertices(3) +
           "property float nx\nproperty float ny\nproperty float nz\nproperty float "
           "red\nproperty float green\nproperty float blue\nproperty float s\nproperty float "
           "t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
           vertex + "\n1 0 0 0 0 2 1 0 0 1 0\n0 1 0 0 1 0 0 0 1 0 1\n3 0 1 2\n";
  };
  for (const std::string none : {"nan", "inf", "1.#QNAN"}) {
    const auto loaded = Ok(LoadMesh(Write("a.ply", text("0 0 0 0 " + none + " 0 0 0 0 0 0"))));
    EXPECT_EQ(loaded->mesh.normals, (std::vector<glm::vec3>{{0, 0, 1}, {0, 0, 1}, {0, 1, 0}}));
    ExpectOnly(loaded->warnings, "normals that are not finite");
    for (const auto& [at, name] : std::vector<std::pair<int, const char*>>{
             {0, "x"}, {1, "y"}, {2, "z"}, {6, "red"}, {8, "blue"}, {9, "s"}, {10, "t"}}) {
      std::string vertex;
      for (int i = 0; i < 11; ++i) vertex += (i == at ? none : "0") + std::string(" ");
      ExpectMessage(LoadPly(text(vertex)), "bad.ply", "vertex 0", "\"" + std::string(name) + "\"",
                    "not a finite number");
    }
  }
}

TEST_F(PlyOffTest, PlyTextureCoordinatesThatAreLeftOutAreSaid) {
  const std::string faces =
      "property float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\n"
      "property list uchar float texcoord\n";
  const auto load = [&](const std::string& second) {
    return LoadMesh(Write("a.ply", Vertices(4) + faces +
                                       "end_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n" +
                                       "3 0 1 2 6 0 0 1 0 1 1\n" + second));
  };
  const auto both = Ok(load("3 0 2 3 6 0 0 1 1 0 1\n"));
  ExpectOnly(both->warnings, "coordinates of vertices left out");
  const auto odd = Ok(load("4 0 1 2 3 6 0 0 1 1 0 1\n"));
  ASSERT_EQ(odd->warnings.size(), 2u);
  ExpectIn(odd->warnings[1], "not two for each corner");
}

// Of vertices and of faces; not where a material is transparent itself, or all alpha is 1.
TEST_F(PlyOffTest, AlphaOfColorsThatIsNotDrawnIsSaid) {
  const auto warnings = [&](const std::string& name, const std::string& text) {
    return Ok(LoadMesh(Write(name, text)))->warnings;
  };
  const std::string corners = "0 0 0\n1 0 0\n0 1 0\n";
  for (const auto& [name, text] :
       {std::pair("a.off", "OFF\n3 1 0\n" + corners + "3 0 1 2 255 0 0 128\n"),
        std::pair("b.off", std::string("COFF\n3 1 0\n0 0 0 1 0 0 0.5\n1 0 0 1 0 0 1\n0 1 0 1 0 0 "
                                       "1\n3 0 1 2\n")),
        std::pair("a.obj",
                  std::string("v 0 0 0 1 0 0 0.5\nv 1 0 0 1 0 0 1\nv 0 1 0 1 0 0 1\nf 1 2 3\n"))}) {
    const auto said = warnings(name, text);
    ExpectOnly(said, "alpha of colours is not drawn");
  }
  EXPECT_TRUE(warnings("c.off", "OFF\n3 1 0\n" + corners + "3 0 1 2 255 0 0 255\n").empty());
  Write("m.mtl", std::string("newmtl m\nd 0.5\n"));
  EXPECT_TRUE(warnings("b.obj",
                       "mtllib m.mtl\nusemtl m\nv 0 0 0 1 0 0 0.5\nv 1 0 0 1 0 0 1\n"
                       "v 0 1 0 1 0 0 1\nf 1 2 3\n")
                  .empty());
}

TEST_F(PlyOffTest, OffColors) {
  const auto load = [&](const std::string& vertices, const std::string& face,
                        std::size_t warnings) {
    auto loaded = Ok(LoadMesh(Write("a.off", vertices + face)));
    EXPECT_EQ(loaded->warnings.size(), warnings);
    return std::move(loaded->mesh);
  };
  const std::string colored = "OFF\n3 1 0\n0 0 0 255 0 0\n1 0 0\n0 1 0 0 0 51 102\n";
  const std::vector<glm::vec4> want = {kRed, kWhite, {0, 0, 0.2f, 0.4f}};
  EXPECT_EQ(load(colored, "3 0 1 2\n", 1).colors, want);  // an alpha that nothing draws
  EXPECT_EQ(load("C" + colored, "3 0 1 2\n", 1).colors, want);
  EXPECT_EQ(load(colored, "3 0 1 2 0 255 0\n", 2).colors, want);  // the face's are left out
  EXPECT_EQ(
      load("OFF\n3 1 0\n0 0 0 1 0 0\n1 0 0 0.5 0.5 0.5\n0 1 0 0 0 1 0.5\n", "3 0 1 2\n", 1).colors,
      (std::vector<glm::vec4>{kRed, {0.5f, 0.5f, 0.5f, 1}, {0, 0, 1, 0.5f}}));
  const std::string plain = "OFF\n4 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  const Mesh faces = load(plain, "4 0 1 2 3 255 0 0\n3 0 1 2\n3 0 1 3 0 255 0 255\n", 0);
  EXPECT_EQ(FaceColors(faces), (std::vector<glm::vec4>{kRed, kRed, kWhite, kGreen}));
  EXPECT_EQ(faces.positions.size(), 4u);
  EXPECT_EQ(FaceColors(load(plain, "3 0 1 2 0 0 1.0\n3 0 1 2 1 0 0\n3 0 1 2 0 1 0\n", 0)),
            (std::vector<glm::vec4>{kBlue, kRed, kGreen}));
  // Nothing beyond 1: nobody writes a black of 1/255.
  EXPECT_EQ(FaceColors(load(plain, "3 0 1 2 0 0 1\n3 0 1 2 1 0 0 1\n3 0 1 2 0 1 0\n", 0)),
            (std::vector<glm::vec4>{kBlue, kRed, kGreen}));
  EXPECT_TRUE(load(plain, "3 0 1 2 17\n3 0 1 2 x\n3 0 1 3\n", 1).corner_colors.empty());
  EXPECT_TRUE(load("OFF\n3 1 0\n0 0 0 1 2\n1 0 0\n0 1 0\n", "3 0 1 2\n", 1).colors.empty());
  ExpectMessage(LoadOff("COFF\n3 1 0\n0 0 0 1 2\n"), "line 3", "colour");
}

}  // namespace tilegrad::io::ply_off_test

// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.h"

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/gltf_fixture.h"
#include "io/image_file.h"
#include "io/sh3f.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::mesh_file_test {

using MeshFileTest = TempFolderTest;

const std::string kTriangleObj =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

// A cube with every kind of data the writer knows.
Mesh RichMesh() {
  Mesh mesh = Box({0, 0, 0}, {1, 2, 3});
  SetColor(mesh, {0.25f, 0.5f, 0.75f, 1});
  for (std::size_t c = 0; c < 3 * mesh.faces.size(); ++c)
    mesh.corner_uvs.emplace_back(0.25f * float(c % 3), 0.1f * float(c % 7));
  mesh.materials = {{.name = "red", .base_color = {1, 0, 0, 1}},
                    {.name = "image", .base_color = glm::vec4(1), .base_color_texture = 0}};
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) mesh.face_materials.push_back(f % 2);
  ImageU8 image(4, 2, 3);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(10 * i);
  mesh.textures = {{"checker", image}};
  return mesh;
}

// Position, uv and colour of every corner, in face order grouped by material: what a viewer would
// draw.
std::vector<std::vector<float>> Corners(const Mesh& mesh) {
  std::vector<std::vector<float>> out;
  for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (mesh.face_materials[f] != static_cast<int>(m)) continue;
      for (int k = 0; k < 3; ++k) {
        const std::int32_t v = mesh.faces[f][static_cast<std::size_t>(k)];
        const glm::vec3 p = mesh.positions[v];
        const glm::vec2 uv = mesh.corner_uvs[3 * f + static_cast<std::size_t>(k)];
        const glm::vec4 c = mesh.colors[v];
        out.push_back({p.x, p.y, p.z, uv.x, uv.y, c.r, c.g, c.b, c.a});
      }
    }
  }
  return out;
}

TEST_F(MeshFileTest, GlbRoundTripKeepsWhatIsDrawn) {
  const Mesh mesh = RichMesh();
  ASSERT_TRUE(SaveGlb(folder_ / "a.glb", mesh).ok());
  const auto loaded = Ok(LoadMesh(folder_ / "a.glb"));
  EXPECT_TRUE(loaded->warnings.empty());
  const auto want = Corners(mesh), got = Corners(loaded->mesh);
  ASSERT_EQ(got.size(), want.size());
  for (std::size_t i = 0; i < want.size(); ++i) {
    for (std::size_t c = 0; c < want[i].size(); ++c)
      EXPECT_NEAR(got[i][c], want[i][c], 1e-6);  // 1 - (1 - v) rounds
  }
  EXPECT_EQ(loaded->mesh.materials[0].base_color, glm::vec4(1, 0, 0, 1));
  ASSERT_EQ(loaded->mesh.textures.size(), 1u);
  EXPECT_EQ(loaded->mesh.textures[0].image.pixels, mesh.textures[0].image.pixels);
}

TEST_F(MeshFileTest, GlbKeepsColorsOfCorners) {
  Mesh mesh = Box({0, 0, 0}, {1, 2, 3});
  for (std::size_t c = 0; c < 3 * mesh.faces.size(); ++c)
    mesh.corner_colors.emplace_back(c / 3 % 2, 0, 1, 1);  // of faces
  ASSERT_TRUE(SaveGlb(folder_ / "a.glb", mesh).ok());
  const auto loaded = Ok(LoadMesh(folder_ / "a.glb"));
  for (std::size_t c = 0; c < mesh.corner_colors.size(); ++c)
    EXPECT_EQ(loaded->mesh.colors[loaded->mesh.faces[c / 3][c % 3]], mesh.corner_colors[c]);
}

// glTF's factors and vertex colours are linear, ours are sRGB-encoded; and a mesh without a
// material gets a plain one, which primitives refer to.
TEST_F(MeshFileTest, GlbStoresLinearColorsAndAlwaysAMaterial) {
  Mesh mesh = Icosphere(0, 1);
  SetColor(mesh, {0.5f, 0, 1, 1});
  const Bytes glb = EncodeGlb(mesh).value();
  std::uint32_t length = 0;
  std::memcpy(&length, &glb[12], sizeof(length));
  const std::size_t binary = 20 + length + 8;
  const auto json = nlohmann::json::parse(&glb[20], &glb[20] + length);
  EXPECT_EQ(json.at("materials").size(), 1u);
  const auto& primitive = json.at("meshes")[0].at("primitives")[0];
  EXPECT_EQ(primitive.at("material"), 0);
  const int color = primitive.at("attributes").at("COLOR_0");
  const int view = json.at("accessors")[color].at("bufferView");
  const std::size_t offset = json.at("bufferViews")[view].at("byteOffset");
  float red = 0;
  std::memcpy(&red, &glb[binary + offset], sizeof(red));
  EXPECT_NEAR(red, 0.21404114f, 1e-6);  // IEC 61966-2-1 at 0.5
}

TEST_F(MeshFileTest, EncodingIsDeterministic) {
  EXPECT_EQ(EncodeGlb(RichMesh()).value(), EncodeGlb(RichMesh()).value());
  EXPECT_FALSE(EncodeGlb(Mesh{}).ok());
}

// ShapeNet's layout: the images lie in a folder beside the model's.
TEST_F(MeshFileTest, TexturesOneFolderUp) {
  std::filesystem::create_directories(folder_ / "models");
  ASSERT_TRUE(SavePng(folder_ / "images" / "t.png", ImageU8(2, 2, 3, 5)).ok());
  Write("models/m.mtl", "newmtl m\nKd 1 1 1\nmap_Kd ../images/t.png\n");
  const auto loaded =
      Ok(LoadMesh(Write("models/m.obj", "mtllib m.mtl\nusemtl m\n" + kTriangleObj)));
  EXPECT_TRUE(loaded->warnings.empty()) << loaded->warnings[0];
  EXPECT_EQ(loaded->mesh.textures.size(), 1u);
}

TEST_F(MeshFileTest, NormalsBecomeUnitAndColorsAreClamped) {
  Write("a.mtl", "newmtl m\nKd 7 0.5 -1\n");
  const auto loaded = Ok(LoadMesh(
      Write("a.obj",
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 3 4\nvn 0 0 0\nvn 1e30 0 0\nusemtl "
            "m\nf 1//1 2//2 3//3\n")));
  const Mesh& mesh = loaded->mesh;
  ASSERT_EQ(mesh.corner_normals.size(), 3u);
  EXPECT_EQ(mesh.corner_normals[0], glm::vec3(0, 0.6f, 0.8f));
  EXPECT_EQ(mesh.corner_normals[1], glm::vec3(0, 0, 1));  // the face's own
  EXPECT_EQ(mesh.corner_normals[2], glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.materials[mesh.face_materials[0]].base_color, glm::vec4(1, 0.5f, 0, 1));
}

TEST_F(MeshFileTest, ReadsFromAZipIgnoringCase) {
  const auto bytes = [](const std::string& text) { return Bytes(text.begin(), text.end()); };
  Ok(WriteZip(folder_ / "a.zip",
              {{"Chair/Chair.OBJ", bytes("mtllib CHAIR.mtl\nusemtl m\n" + kTriangleObj)},
               {"Chair/chair.mtl", bytes("newmtl m\nKd 0 1 0\n")}}));
  const auto zip = Ok(OpenZip(folder_ / "a.zip"));
  const auto loaded = Ok(LoadMesh(**zip, "chair/chair.obj"));
  EXPECT_EQ(loaded->mesh.materials[loaded->mesh.face_materials[0]].base_color.g, 1);
}

// What these files lack or have too much of, as their authors left them.
constexpr std::array kHarmless = {"not found", "left out", "white instead",
                                  "no texture coordinates", "statements that are not read"};

TEST(MeshFileLong, EveryModelOfTheFurniturePackageLoads) {
  const Path folder = "/usr/share/sweethome3d/furniture";
  if (!std::filesystem::exists(folder))
    GTEST_SKIP() << "Debian's sweethome3d-furniture is not installed";
  int models = 0, textured = 0;
  std::vector<std::string> warnings;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".sh3f") continue;
    const auto zip = Ok(OpenZip(entry.path()));
    const auto catalog = Ok(ReadFurnitureCatalog(**zip));
    for (const FurnitureEntry& item : catalog->entries) {
      const auto loaded = LoadMesh(**zip, item.model);
      ++models;
      ASSERT_TRUE(loaded.ok()) << loaded.status().message();
      textured += !loaded->mesh.textures.empty();
      for (const std::string& warning : loaded->warnings)
        warnings.push_back(item.model + ": " + warning);
    }
  }
  EXPECT_EQ(models, 820);
  for (const std::string& warning : warnings) {
    const bool harmless = std::any_of(kHarmless.begin(), kHarmless.end(), [&](const char* part) {
      return warning.find(part) != std::string::npos;
    });
    EXPECT_TRUE(harmless) << warning;
  }
  EXPECT_GT(textured, 350);
}

// Coordinates far from the origin: what is subtracted, and what a file has no digits for.

const glm::dvec3 kPlace(431000, 4600000, 300);

class MeshOriginTest : public TempFolderTest {
 protected:
  LoadedMesh Load(const Path& path) { return Ok(LoadMesh(path)).value(); }
};

// The unit sphere, its vertices with `digits` digits, around `place`.
std::string Rows(const char* format, const glm::dvec3& place) {
  std::string out;
  for (const glm::vec3& v : Icosphere(2, 1).positions) {
    const glm::dvec3 p = place + glm::dvec3(v);
    out += fmt::format(fmt::runtime(format), p.x, p.y, p.z);
  }
  return out;
}

std::string FaceRows(const char* format, int from) {
  std::string out;
  for (const auto& [a, b, c] : Icosphere(2, 1).faces)
    out += fmt::format(fmt::runtime(format), a + from, b + from, c + from);
  return out;
}

std::string Ply(const char* type, const std::string& rows) {
  return fmt::format(
             "ply\nformat ascii 1.0\nelement vertex 162\nproperty {0} x\nproperty {0} y\n"
             "property {0} z\nelement face 320\nproperty list uchar int "
             "vertex_indices\nend_header\n",
             type) +
         rows + FaceRows("3 {} {} {}\n", 0);
}

std::string Off(const std::string& rows) {
  return "OFF\n162 320 0\n" + rows + FaceRows("3 {} {} {}\n", 0);
}

std::string Obj(const std::string& rows) { return rows + FaceRows("f {} {} {}\n", 1); }

void ExpectRound(const LoadedMesh& loaded, double tolerance) {
  EXPECT_EQ(loaded.origin, kPlace);
  ASSERT_EQ(loaded.mesh.positions.size(), 162u);
  for (const glm::vec3& p : loaded.mesh.positions)
    EXPECT_NEAR(glm::length(glm::dvec3(p)), 1, tolerance);
  ASSERT_FALSE(loaded.warnings.empty());
  ExpectIn(loaded.warnings[0], "(431000, 4600000, 300) was subtracted");
}

TEST_F(MeshOriginTest, TextWithDigitsIsRound) {
  const std::string rows = Rows("{:.6f} {:.6f} {:.6f}\n", kPlace);
  for (const Path& path : {Write("a.obj", Obj(Rows("v {:.6f} {:.6f} {:.6f}\n", kPlace))),
                           Write("a.ply", Ply("double", rows)), Write("a.off", Off(rows))}) {
    SCOPED_TRACE(path.string());
    const auto loaded = Load(path);
    ExpectRound(loaded, 2e-6);  // digits to 5e-7 in each of three, and 2^-24
    EXPECT_EQ(loaded.warnings.size(), 1u) << fmt::format("{}", fmt::join(loaded.warnings, "|"));
  }
}

// In float, 4600000 has steps of 0.5.
TEST_F(MeshOriginTest, CoordinatesWithoutDigitsAreAWarning) {
  std::string rows;
  for (const glm::vec3& v : Icosphere(2, 1).positions) {
    const glm::vec3 p(kPlace + glm::dvec3(v));
    rows += fmt::format("{:.12g} {:.12g} {:.12g}\n", p.x, p.y, p.z);
  }
  for (const Path& path : {Write("a.ply", Ply("float", rows)), Write("a.off", Off(rows))}) {
    const auto loaded = Load(path);
    ASSERT_EQ(loaded.warnings.size(), 2u);
    ExpectIn(loaded.warnings[1], "x, y come in steps of 0.5, and the mesh is 2 across");
  }
  // Seven digits leave 1 of the y.
  const auto short_text = Load(Write("b.obj", Obj(Rows("v {:.7g} {:.7g} {:.7g}\n", kPlace))));
  ASSERT_EQ(short_text.warnings.size(), 2u);
  ExpectIn(short_text.warnings[1], "y come in steps of 1,");
}

// Nothing is subtracted from what float can hold, and not a bit changes.
TEST_F(MeshOriginTest, NearMeshesStayAsTheyAre) {
  for (const double far : {0.0, 1.0, 500.0}) {  // 501 is less than 256 times 2
    const auto loaded = Load(Write("a.off", Off(Rows("{:.9g} {:.9g} {:.9g}\n", {far, 0, 0}))));
    EXPECT_EQ(loaded.origin, glm::dvec3(0));
    EXPECT_TRUE(loaded.warnings.empty());
    EXPECT_NEAR(loaded.mesh.positions[0].x, far + Icosphere(2, 1).positions[0].x, 3e-5);
  }
  EXPECT_EQ(Load(Write("b.off", Off(Rows("{:.9g} {:.9g} {:.9g}\n", {520, 0, 0})))).origin,
            glm::dvec3(520, 0, 0));
}

// A vertex that no face uses has no say; its place stays right.
TEST_F(MeshOriginTest, UnusedVerticesDoNotCount) {
  const auto loaded =
      Load(Write("a.obj", Obj(Rows("v {:.6f} {:.6f} {:.6f}\n", kPlace)) + "v 0 0 0\n"));
  EXPECT_EQ(loaded.origin, kPlace);
  EXPECT_EQ(loaded.mesh.positions.back(), glm::vec3(-431000, -4600000, -300));
}

// A notched polygon, whose corners float would move by half of its size.
TEST_F(MeshOriginTest, PolygonsAreCutRightFarAway) {
  const auto loaded =
      Load(Write("a.obj",
                 "v 431000.1 4600000.1 300\nv 431000.9 4600000.1 300\nv 431000.9 4600000.9 300\n"
                 "v 431000.5 4600000.2 300\nv 431000.1 4600000.9 300\nf 1 2 3 4 5\n"));
  ASSERT_EQ(loaded.mesh.faces.size(), 3u);
  for (const auto& [a, b, c] : loaded.mesh.faces) {
    const auto& p = loaded.mesh.positions;
    EXPECT_GT(glm::cross(p[b] - p[a], p[c] - p[a]).z, 0);
  }
}

// A triangle strip's four vertices (x, y, 0) in float, twice, and both of its triangles.
class GltfOriginTest : public GltfTest {
 protected:
  GltfOriginTest() {
    Begin(R"({"asset": {"version": "2.0"}, "materials": [{"name": "a"}, {"name": "b"}],
              "scenes": [{"nodes": [0]}], "bufferViews": [], "accessors": []})");
    const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
    Add("VEC3", corners);
    Add<std::uint16_t>("SCALAR", {0, 1, 2});
    Add<std::uint16_t>("SCALAR", {2, 1, 3});
    Add("VEC3", corners);
  }
  static Json Primitive(int position, int indices, int material) {
    return {{"attributes", {{"POSITION", position}}}, {"indices", indices}, {"material", material}};
  }
  LoadedMesh Load(const Json& nodes, const Json& primitives) {
    json_["nodes"] = nodes;
    json_["meshes"] = Json::array({{{"primitives", primitives}}});
    return Ok(LoadMesh(File())).value();
  }
};

// The vertices are local, two nodes carry the place: their sum is formed in double.
TEST_F(GltfOriginTest, NodesFarAway) {
  const Json nodes = {{{"translation", {400000.25, 4600000.125, 300}}, {"children", {1, 2}}},
                      {{"mesh", 0}, {"translation", {31000.125, 0, 0}}},
                      {{"camera", 0}, {"translation", {31000.125, 0, 3}}}};
  json_["cameras"] =
      Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}});
  const auto loaded = Load(nodes, Json::array({Primitive(0, 1, 0)}));
  EXPECT_EQ(loaded.origin, glm::dvec3(431001, 4600001, 300));
  ASSERT_EQ(loaded.mesh.positions.size(), 4u);
  EXPECT_EQ(loaded.mesh.positions[3], glm::vec3(0.375f, 0.125f, 0));
  EXPECT_EQ(glm::dvec3(loaded.mesh.positions[0]) + loaded.origin,
            glm::dvec3(431000.375, 4600000.125, 300));
  ASSERT_EQ(loaded.cameras.size(), 1u);  // it looks at the corner from 3 above, as in the file
  const auto& m = loaded.cameras[0].camera.node_to_world;
  EXPECT_EQ(glm::dvec3(m[3], m[7], m[11]), glm::dvec3(-0.625, -0.875, 3));
  EXPECT_EQ(loaded.warnings.size(), 1u) << fmt::format("{}", fmt::join(loaded.warnings, "|"));
}

// Normals that a part has not are made of its own small numbers, first or last: in float, all four
// corners have one x.
TEST_F(GltfOriginTest, NormalsOfPartsWithoutAny) {
  const Json nodes = Json::array({{{"mesh", 0},
                                   {"translation", {4600000, 300, 0.5}},
                                   {"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}},
                                   {"scale", {0.1, 0.1, 0.1}}}});
  Json with = Primitive(3, 1, 1);
  with["attributes"]["NORMAL"] = 0;  // its own positions, which are no normals of the plane
  for (const bool first : {false, true}) {
    const Json parts = first ? Json{with, Primitive(0, 1, 0)} : Json{Primitive(0, 1, 0), with};
    const auto loaded = Load(nodes, parts);
    ASSERT_EQ(loaded.mesh.normals.size(), 8u);
    for (std::size_t v = 0; v < 3; ++v) {  // the turned plane faces -y
      const glm::vec3 n = loaded.mesh.normals[v + (first ? 4 : 0)];
      EXPECT_LT(glm::length(n - glm::vec3(0, -1, 0)), 1e-6f) << n.x << " " << n.y << " " << n.z;
    }
  }
}

// Primitives of one mesh with one accessor of positions share its vertices; others do not.
TEST_F(GltfOriginTest, SharedAccessors) {
  const Json nodes = Json::array({{{"mesh", 0}}});
  const auto shared = Load(nodes, {Primitive(0, 1, 0), Primitive(0, 2, 1)});
  EXPECT_EQ(shared.mesh.positions,
            (std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
  EXPECT_EQ(shared.mesh.faces, (std::vector<Face>{{0, 1, 2}, {2, 1, 3}}));
  EXPECT_EQ(shared.mesh.face_materials, (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(shared.mesh.materials[1].name, "b");
  const auto apart = Load(nodes, {Primitive(0, 1, 0), Primitive(3, 2, 1), Primitive(0, 2, 0)});
  EXPECT_EQ(apart.mesh.positions.size(), 8u);
  EXPECT_EQ(apart.mesh.faces, (std::vector<Face>{{0, 1, 2}, {6, 5, 7}, {2, 1, 3}}));
  EXPECT_EQ(apart.mesh.face_materials, (std::vector<std::int32_t>{0, 1, 0}));
}

}  // namespace tilegrad::io::mesh_file_test

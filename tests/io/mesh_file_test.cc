// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "io/glb_writer.h"
#include "io/image_file.h"
#include "io/sh3f.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::mesh_file_test {

class MeshFileTest : public TempFolderTest {
 protected:
  Status LoadStatus(const Path& path) { return LoadMesh(path).status(); }
};

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

// --- broken files: an error that names the file, never a crash ---

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

TEST_F(MeshFileTest, NonFiniteEmptyAndUnknown) {
  ExpectMessage(LoadStatus(Write("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), "nan.obj");
  ExpectMessage(LoadStatus(Write("big.obj", "v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), "big.obj");
  ExpectMessage(LoadStatus(Write("empty.obj", "")), "empty.obj");
  ExpectMessage(LoadStatus(Write("points.obj", "v 0 0 0\nv 1 0 0\n")), "points.obj");
  ExpectMessage(LoadStatus(Write("garbage.ply", std::string(200, '\xff'))), "garbage.ply");
  ExpectMessage(LoadStatus(Write("a.txt", "hello")), "a.txt", "supported mesh format");
  ExpectMessage(LoadStatus(folder_ / "missing.obj"), "missing.obj");
}

TEST_F(MeshFileTest, ReadsFromAZipIgnoringCase) {
  const auto bytes = [](const std::string& text) { return Bytes(text.begin(), text.end()); };
  ASSERT_TRUE(WriteZip(folder_ / "a.zip",
                       {{"Chair/Chair.OBJ", bytes("mtllib CHAIR.mtl\nusemtl m\n" + kTriangleObj)},
                        {"Chair/chair.mtl", bytes("newmtl m\nKd 0 1 0\n")}})
                  .ok());
  const auto zip = Ok(OpenZip(folder_ / "a.zip"));
  const auto loaded = LoadMesh(**zip, "chair/chair.obj");
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
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
    const auto catalog = ReadFurnitureCatalog(**zip);
    ASSERT_TRUE(catalog.ok()) << catalog.status().message();
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

}  // namespace tilegrad::io::mesh_file_test

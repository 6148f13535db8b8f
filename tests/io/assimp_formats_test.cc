// SPDX-License-Identifier: Apache-2.0
// Each format that Assimp reads for us: a sound file gives its mesh. Damaged ones: the fuzz target
// `assimp`.
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "io/image_file.h"
#include "io/imported_scene.h"
#include "io/mesh_file.h"
#include "io/mesh_readers.h"
#include "io/mesh_samples.h"
#include "support/temp_folder.h"

namespace tilegrad::io::assimp_formats_test {

class AssimpFormatsTest : public TempFolderTest {};

std::array<float, 3> SortedExtents(const Mesh& mesh) {
  const Bounds b = MeshBounds(mesh);
  std::array<float, 3> extents = {b.high.x - b.low.x, b.high.y - b.low.y, b.high.z - b.low.z};
  std::sort(extents.begin(), extents.end());
  return extents;
}

TEST_F(AssimpFormatsTest, SoundFilesAreRead) {
  for (const MeshSample& sample : MakeMeshSamples(folder_)) {
    SCOPED_TRACE(sample.name);
    const auto loaded = LoadMesh(Write(sample.name, sample.bytes));
    EXPECT_TRUE(loaded.ok()) << loaded.status().message();
    if (!loaded.ok()) continue;
    const Mesh& mesh = loaded->mesh;
    EXPECT_EQ(mesh.faces.size(), 4u);
    EXPECT_EQ(mesh.positions.size(), 4u);
    EXPECT_TRUE(loaded->warnings.empty()) << loaded->warnings[0];
    const auto extents = SortedExtents(mesh);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(extents[i], 1 + i, 1e-5);
    // Have no materials, or none with a colour.
    if (sample.name.ends_with(".stl") || sample.name.ends_with(".md2")) continue;
    const glm::vec4 color = mesh.materials[mesh.face_materials[0]].base_color;
    const glm::vec4 want(0.8f, 0.2f, 0.4f, 1);
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(color[c], want[c], 1.0 / 255);  // 3DS, 3MF hold bytes
  }
}

TEST_F(AssimpFormatsTest, WhatStopsTheReaderIsAnErrorWithTheFilesName) {
  GuardLimits limits;
  limits.wall_seconds = 0;
  const Bytes file = Bytes(100, 0);
  ExpectMessage(ReadByAssimp(*OpenFolder(folder_), "a.FBX", file, limits).status(), "a.FBX",
                "the .fbx reader took more than 0 s");
}

TEST_F(AssimpFormatsTest, FacesWithoutIndicesAreLeftOut) {
  const auto loaded = Ok(LoadMesh(Write("a.x",
                                        "xof 0303txt 0032\nMesh t {\n"
                                        "4;\n0;0;0;,1;0;0;,0;2;0;,0;0;3;;\n"
                                        "3;\n3;0,2,1;,0;,3;0,1,3;;\n}\n")));
  EXPECT_EQ(loaded->mesh.faces.size(), 2u);
}

TEST_F(AssimpFormatsTest, UnknownEndingsNameTheKnownOnes) {
  ExpectMessage(LoadMesh(Write("a.max", "x")).status(), "a.max", "\".max\"", ".glb, .gltf, .obj",
                ".fbx", ".ms3d", ".md2");
}

// MD2 and its skins.
class Md2Test : public TempFolderTest {
 protected:
  void SetUp() override { ASSERT_TRUE(SavePng(folder_ / "red.png", ImageU8(4, 2, 3, 50)).ok()); }
  // Corner i lies at pixel (i, i / 2) of the skin, whose name stands behind the header.
  LoadedMesh Load(const std::string& skin) {
    Bytes file = StoredSample("skin.md2");
    std::copy(skin.begin(), skin.end(), file.begin() + 68);
    return Ok(LoadMesh(Write("a.md2", file))).value();
  }
};

// Beside the mesh by its name, whatever path and ending the file says.
TEST_F(Md2Test, SkinsAreFoundByName) {
  for (const char* skin : {"red.png", ".red", "red", "models/cars/red.pcx", "models\\cars\\red"}) {
    const LoadedMesh loaded = Load(skin);
    EXPECT_TRUE(loaded.warnings.empty()) << skin << ": " << loaded.warnings[0];
    ASSERT_EQ(loaded.mesh.textures.size(), 1u) << skin;
    EXPECT_EQ(loaded.mesh.materials.at(0).base_color_texture, 0);
  }
  const LoadedMesh none = Load(".blue");
  ExpectOnly(none.warnings, ".blue");
}

// z of the file is up: y here. Pixels are counted from the skin's upper left corner.
TEST_F(Md2Test, AxesAndUv) {
  const LoadedMesh loaded = Load(".red");
  const Bounds bounds = MeshBounds(loaded.mesh);
  EXPECT_NEAR(bounds.high.y - bounds.low.y, 3, 1e-5);
  const auto top = std::find_if(loaded.mesh.positions.begin(), loaded.mesh.positions.end(),
                                [&](glm::vec3 p) { return p.y > bounds.high.y - 0.5f; });
  const auto top_vertex = static_cast<std::int32_t>(top - loaded.mesh.positions.begin());
  int found = 0;
  for (std::size_t c = 0; c < loaded.mesh.corner_uvs.size(); ++c) {
    if (loaded.mesh.faces[c / 3][c % 3] != top_vertex) continue;
    ++found;  // corner 3, at pixel (3, 1) of 4 x 2
    EXPECT_NEAR(loaded.mesh.corner_uvs[c].x, 0.75f, 1e-5);
    EXPECT_NEAR(loaded.mesh.corner_uvs[c].y, 0.5f, 1e-5);
  }
  EXPECT_EQ(found, 3);
}

// The scene sent by the importing process: round trip, and arbitrary bytes.
ImportedScene Scene() {
  ImportedScene scene;
  ImportedPart part;
  part.name = "part";
  part.positions = part.normals = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  part.uvs.resize(3);
  part.colors.resize(3, glm::vec4(1));
  part.triangles = {{0, 1, 2}};
  scene.parts = {part};
  scene.materials = {{"m", glm::vec4(0.5f), "image.png", 0, ""}};
  scene.images = {{"image.png", Bytes(20, 3)}};
  scene.instances = {{0, glm::dmat4x3(2)}};
  scene.warnings = {"left out"};
  return scene;
}

Status Decode(const ImportedScene& scene) { return DecodeScene(EncodeScene(scene)).status(); }

TEST(ImportedScene, RoundTrip) {
  const auto back = Ok(DecodeScene(EncodeScene(Scene())));
  EXPECT_EQ(back->parts[0].positions, Scene().parts[0].positions);
  EXPECT_EQ(back->parts[0].triangles, Scene().parts[0].triangles);
  EXPECT_EQ(back->materials[0].image, "image.png");
  EXPECT_EQ(back->images[0].bytes, Bytes(20, 3));
  EXPECT_EQ(back->instances[0].to_scene, glm::dmat4x3(2));
  EXPECT_EQ(back->warnings, Scene().warnings);
  ExpectCutsRefused(EncodeScene(Scene()), "", [](const Bytes& cut) {
    return DecodeScene({cut.data(), cut.size()}).status();
  });
}

TEST(ImportedScene, ErrorsAreHandedOver) {
  ExpectMessage(DecodeScene(EncodeScene(DataLoss("line 3"))).status(), "line 3");
  ExpectMessage(DecodeScene(EncodeScene(DataLoss(""))).status(), "incomplete data");
}

TEST(ImportedScene, IndicesAndCountsAreChecked) {
  ImportedScene scene = Scene();
  scene.parts[0].triangles[0][2] = 3;
  ExpectMessage(Decode(scene), "vertex 3 of 3");
  scene = Scene();
  scene.parts[0].uvs.pop_back();
  ExpectMessage(Decode(scene), "2 attributes for 3 vertices");
  scene = Scene();
  scene.instances[0].part = 1;
  ExpectMessage(Decode(scene), "part 1 of 1");
  for (const int image : {1, -2}) {
    scene = Scene();
    scene.materials[0].embedded = image;
    ExpectMessage(Decode(scene), "image", "of 1");
  }
}

// The colours that Magics and VisCAM keep in the two bytes behind a facet of binary STL.
using Colours = std::vector<glm::vec4>;

const glm::vec4 kRed(1, 0, 0, 1), kGreen(0, 1, 0, 1), kBlue(0, 0, 1, 1), kBlack(0, 0, 0, 1),
    kWhite(1), kOfHeader(1, 0.2f, 0.6f, 1);
const std::string kMagics = "made by us; COLOR=\xff\x33\x99\xff,MATERIAL=";
constexpr std::uint16_t kMark = 0x8000, kLow = 31, kMiddle = 31 << 5, kHigh = 31 << 10;

class StlColors : public TempFolderTest {
 protected:
  // A binary file with a facet for each attribute.
  Path File(std::string bytes, const std::vector<std::uint16_t>& attributes) {
    bytes.resize(80, ' ');
    const auto count = static_cast<std::uint32_t>(attributes.size());
    bytes.append(reinterpret_cast<const char*>(&count), 4);
    for (const std::uint16_t attribute : attributes) {
      const float numbers[] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};
      bytes.append(reinterpret_cast<const char*>(numbers), sizeof(numbers));
      bytes.append(reinterpret_cast<const char*>(&attribute), 2);
    }
    return Write("a.stl", bytes);
  }

  void Expect(const std::string& header, const std::vector<std::uint16_t>& attributes,
              const Colours& want) {
    const auto loaded = Ok(LoadMesh(File(header, attributes)));
    const Mesh& mesh = loaded->mesh;
    ASSERT_EQ(mesh.faces.size(), want.size());
    for (std::size_t f = 0; f < want.size(); ++f) {
      for (const std::int32_t v : mesh.faces[f]) {
        const glm::vec4 own = mesh.colors.empty() ? kWhite : mesh.colors[v];
        EXPECT_LT(glm::distance(own * mesh.materials.at(0).base_color, want[f]), 1e-5f) << f;
      }
    }
  }
};

// Bit 15 means the object's colour, red is in the low bits.
TEST_F(StlColors, MagicsMarksFacetsOfTheObjectsColour) {
  Expect(kMagics, {kMark, kMark}, {kOfHeader, kOfHeader});
  Expect(kMagics, {kLow, kMiddle, kHigh, kMark}, {kRed, kGreen, kBlue, kOfHeader});
  Expect(kMagics, {0, kMark | kHigh}, {kBlack, kOfHeader});
  Expect(kMagics, {0, 0}, {kOfHeader, kOfHeader});  // nobody wrote colours
}

// Bit 15 means that the facet has a colour, blue is in the low bits.
TEST_F(StlColors, ViscamMarksFacetsThatHaveAColour) {
  Expect("x", {kMark | kHigh, kMark | kMiddle, kMark | kLow, 0}, {kRed, kGreen, kBlue, kWhite});
  Expect("x", {0, 0}, {kWhite, kWhite});
  Expect("x", {kLow, kHigh}, {kWhite, kWhite});
}

}  // namespace tilegrad::io::assimp_formats_test

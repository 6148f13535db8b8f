// SPDX-License-Identifier: Apache-2.0
// The files that a glTF names, buffers and images: one rule for their URIs, and what of the model
// is left out.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::gltf_files_test {

using Json = nlohmann::json;

constexpr std::array<std::uint8_t, 3> kRed = {255, 0, 0}, kBlue = {0, 0, 255};

// Triangles of one material each, with uv, whose numbers are in buffers and images of any name.
class GltfFiles : public TempFolderTest {
 protected:
  GltfFiles() {
    json_ = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}],
                            "nodes": [], "meshes": [], "materials": [], "textures": [],
                            "images": [], "buffers": [], "bufferViews": [], "accessors": []})");
  }

  // A file of a triangle at x, and `more` bytes behind.
  void WriteBuffer(const std::string& file, float x, std::size_t more = 0) {
    const std::vector<float> numbers = {x, 0, 0, x + 1, 0, 0, x, 1, 0, 0, 0, 1, 0, 0, 1};
    std::string bytes(reinterpret_cast<const char*>(numbers.data()), 60);
    Write(file, bytes.append(more, 'x'));
  }
  Bytes Picture(std::array<std::uint8_t, 3> color) {
    ImageU8 image(1, 1, 3);
    std::copy(color.begin(), color.end(), image.pixels.begin());
    return EncodePng(image).value();
  }
  void WritePicture(const std::string& file, std::array<std::uint8_t, 3> color) {
    Write(file, Picture(color));
  }

  void AddTriangle(const std::string& buffer_uri, const Json& image) {
    const std::size_t buffer = json_["buffers"].size(), view = json_["bufferViews"].size(),
                      accessor = json_["accessors"].size(), mesh = json_["meshes"].size();
    json_["buffers"].push_back({{"uri", buffer_uri}, {"byteLength", 60}});
    json_["bufferViews"].push_back({{"buffer", buffer}, {"byteLength", 36}});
    json_["bufferViews"].push_back({{"buffer", buffer}, {"byteOffset", 36}, {"byteLength", 24}});
    for (const auto& [at, type] : {std::pair(view, "VEC3"), std::pair(view + 1, "VEC2")}) {
      json_["accessors"].push_back(
          {{"bufferView", at}, {"componentType", 5126}, {"count", 3}, {"type", type}});
    }
    json_["images"].push_back(image);
    json_["textures"].push_back({{"source", mesh}});
    json_["materials"].push_back(
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", mesh}}}}}});
    json_["meshes"].push_back(
        {{"primitives",
          {{{"attributes", {{"POSITION", accessor}, {"TEXCOORD_0", accessor + 1}}},
            {"material", mesh}}}}});
    json_["scenes"][0]["nodes"].push_back(json_["nodes"].size());
    json_["nodes"].push_back({{"mesh", mesh}});
  }
  // The index of a view of these bytes, in a buffer of their own.
  std::size_t AddView(const Bytes& bytes) {
    const std::string file = "own" + std::to_string(json_["buffers"].size()) + ".bin";
    Write(file, bytes);
    json_["bufferViews"].push_back(
        {{"buffer", json_["buffers"].size()}, {"byteLength", bytes.size()}});
    json_["buffers"].push_back({{"uri", file}, {"byteLength", bytes.size()}});
    return json_["bufferViews"].size() - 1;
  }

  Path File() { return Write("a.gltf", json_.dump()); }
  LoadedMesh Load(std::size_t warnings = 0) {
    auto loaded = Ok(LoadMesh(File()));
    EXPECT_EQ(loaded->warnings.size(), warnings)
        << (loaded->warnings.empty() ? "none" : loaded->warnings[0]);
    return std::move(*loaded);
  }

  Json json_;
};

// The colour that the picture of each face's material has.
std::vector<std::array<std::uint8_t, 3>> FaceColors(const Mesh& mesh) {
  std::vector<std::array<std::uint8_t, 3>> colors;
  for (const std::int32_t m : mesh.face_materials) {
    const int texture = mesh.materials[m].base_color_texture;
    EXPECT_GE(texture, 0);
    if (texture < 0) return {};
    const auto& pixels = mesh.textures[texture].image.pixels;
    colors.push_back({pixels[0], pixels[1], pixels[2]});
  }
  return colors;
}

TEST_F(GltfFiles, UrisOfBuffersAndImagesMeanTheSame) {
  for (const auto& [file, uri] : std::vector<std::pair<std::string, std::string>>{
           {"plain", "plain"},
           {"chair+table", "chair+table"},
           {"chair+table", "chair%2Btable"},
           {"my chair", "my%20chair"},
           {"my chair", "my chair"},
           {"50%", "50%25"},
           {"50%", "50%"},
           {"50%25", "50%2525"},
           {"100%zz", "100%zz"},
           {"as%20written", "as%20written"},  // of exporters that encode nothing
           {"\xc3\xa9", "%C3%A9"},
           {"\xc3\xa9", "\xc3\xa9"},
           {"a&b=c;d,e'f(g)[h]!@$", "a&b=c;d,e'f(g)[h]!@$"},
           {"sub/far", "sub/far"},
           {"sub/far", "./sub/../sub/far"},
           {"sub/far", "sub\\far"}}) {
    SCOPED_TRACE(uri);
    const Json empty = json_;
    WriteBuffer(file + ".bin", 7);
    WritePicture(file + ".png", kRed);
    AddTriangle(uri + ".bin", {{"uri", uri + ".png"}});
    const Mesh mesh = Load().mesh;
    ASSERT_EQ(mesh.faces.size(), 1u);
    EXPECT_EQ(mesh.positions[1], glm::vec3(8, 0, 0));
    EXPECT_EQ(FaceColors(mesh), (std::vector{kRed}));
    json_ = empty;
  }
}

// To tinygltf, "+" and "%20" are the same.
TEST_F(GltfFiles, NamesThatDifferByASpaceAreTwoFiles) {
  WriteBuffer("a+b.bin", 0);
  WriteBuffer("a b.bin", 5);
  WritePicture("a+b.png", kRed);
  WritePicture("a b.png", kBlue);
  AddTriangle("a+b.bin", {{"uri", "a+b.png"}});
  AddTriangle("a%20b.bin", {{"uri", "a%20b.png"}});
  const Mesh mesh = Load().mesh;
  EXPECT_EQ(mesh.positions.at(0), glm::vec3(0, 0, 0));
  EXPECT_EQ(mesh.positions.at(3), glm::vec3(5, 0, 0));
  EXPECT_EQ(FaceColors(mesh), (std::vector{kRed, kBlue}));
}

TEST_F(GltfFiles, BuffersMayBeShorterThanTheirFiles) {
  WriteBuffer("a.bin", 2, 4);
  WritePicture("a.png", kRed);
  AddTriangle("a.bin", {{"uri", "a.png"}});
  EXPECT_EQ(Load().mesh.positions.at(0), glm::vec3(2, 0, 0));
  json_["buffers"][0]["byteLength"] = 65;
  ExpectMessage(LoadMesh(File()).status(), "a.gltf", "a.bin has 64 bytes, its buffer 65");
  json_["buffers"][0]["uri"] = "no+where.bin";
  ExpectMessage(LoadMesh(File()).status(), "a.gltf", "\"no+where.bin\"");
}

TEST_F(GltfFiles, AnImageInTheFileAndOneBesideItMayShareTheirName) {
  WriteBuffer("a.bin", 0);
  WritePicture("red.png", kRed);
  const Json inside = {
      {"bufferView", AddView(Picture(kBlue))}, {"mimeType", "image/png"}, {"name", "red.png"}};
  const Json other = {{"bufferView", AddView(Picture({0, 255, 0}))},
                      {"mimeType", "image/png"},
                      {"name", "red.png"}};
  const Json beside = {{"uri", "red.png"}};
  for (const Json& image : {inside, beside, other, beside}) AddTriangle("a.bin", image);
  const Mesh mesh = Load().mesh;
  EXPECT_EQ(FaceColors(mesh),
            (std::vector<std::array<std::uint8_t, 3>>{kBlue, kRed, {0, 255, 0}, kRed}));
  EXPECT_EQ(mesh.textures.size(), 3u);  // the file's once
}

TEST_F(GltfFiles, ImagesInOtherKindsOfDataAreNamedBriefly) {
  WriteBuffer("a.bin", 0);
  AddTriangle("a.bin", {{"uri", "data:image/webp;base64," + std::string(5000, 'A')}});
  const auto warnings = Load(1).warnings;
  EXPECT_NE(warnings.at(0).find("data:image/webp;base64\" is not read"), std::string::npos)
      << warnings[0];
  EXPECT_LT(warnings[0].size(), 200u);
}

TEST_F(GltfFiles, ColoursBeyondTheFirstSetAndOtherScenesAreSaid) {
  WriteBuffer("a.bin", 0);
  WritePicture("a.png", kRed);
  AddTriangle("a.bin", {{"uri", "a.png"}});
  AddTriangle("a.bin", {{"uri", "a.png"}});
  json_["scenes"] = {{{"nodes", {0}}}, {{"nodes", {1}}}};
  const auto scenes = Load(1);
  EXPECT_EQ(scenes.mesh.faces.size(), 1u);
  EXPECT_EQ(scenes.warnings.at(0), "meshes that are not in the scene are left out");
  json_["scenes"] = {{{"nodes", {0, 1}}}};
  for (Json& mesh : json_["meshes"]) {
    mesh["primitives"][0]["attributes"]["COLOR_0"] = 0;
    mesh["primitives"][0]["attributes"]["COLOR_1"] = 0;
  }
  EXPECT_EQ(Load(1).warnings.at(0), "sets of vertex colours but COLOR_0 are left out");
}

}  // namespace tilegrad::io::gltf_files_test

// SPDX-License-Identifier: Apache-2.0
// The files that a glTF names, buffers and images: one rule for their URIs, and what of the model
// is left out.
#include <gtest/gtest.h>

#include <cstring>
#include <glm/geometric.hpp>

#include "io/gltf_fixture.h"
#include "io/image_file.h"
#include "io/mesh_file.h"

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

// glTF beyond geometry: cameras, samplers, texture transforms, how materials are drawn.

// One triangle with uv (0,0), (1,0), (0,1), a material with a texture, a camera on a node.
constexpr std::array kMirrored = {TextureWrap::kMirror, TextureWrap::kMirror};

class GltfScene : public GltfTest {
 protected:
  GltfScene() {
    EXPECT_TRUE(io::SavePng(folder_ / "t.png", ImageU8(2, 2, 3, 200)).ok());
    Begin(R"({
      "asset": {"version": "2.0"},
      "scenes": [{"nodes": [0, 1]}], "scene": 0,
      "nodes": [{"mesh": 0},
                {"camera": 0, "name": "eye", "translation": [1, 2, 3], "scale": [2, 2, 2]}],
      "cameras": [{"type": "perspective",
                   "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.25}}],
      "bufferViews": [], "accessors": [],
      "images": [{"uri": "t.png"}],
      "samplers": [{"wrapS": 33648, "wrapT": 33648, "magFilter": 9728}],
      "textures": [{"source": 0, "sampler": 0}],
      "materials": [{"name": "m", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                                  "material": 0}]}]})");
    Add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
    Add<float>("VEC2", {0, 0, 1, 0, 0, 1});
  }
  io::LoadedMesh Load() { return Ok(io::LoadMesh(File())).value(); }
  Json& Texture() { return json_["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]; }
};

TEST_F(GltfScene, CameraStandsAtItsNode) {
  const auto loaded = Load();
  ASSERT_EQ(loaded.cameras.size(), 1u);
  EXPECT_EQ(loaded.cameras[0].name, "eye");
  const auto camera = Ok(FromGltf(loaded.cameras[0].camera, {300, 200}));
  EXPECT_EQ(camera->translation[1], -2);
  EXPECT_EQ(camera->near_plane, 0.25);
  EXPECT_NEAR(camera->fx, camera->fy, 1e-9);  // 1.5 is the image's own aspect ratio
}

TEST_F(GltfScene, OrthographicCamerasAreLeftOutWithAWord) {
  json_["cameras"][0] = {{"type", "orthographic"},
                         {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"zfar", 9}, {"znear", 1}}}};
  const auto loaded = Load();
  EXPECT_TRUE(loaded.cameras.empty());
  ExpectOnly(loaded.warnings, "orthographic");
}

TEST_F(GltfScene, SamplersAndDrawing) {
  Material m = Load().mesh.materials[0];
  EXPECT_EQ(m.wrap, kMirrored);
  EXPECT_TRUE(m.nearest);
  EXPECT_FALSE(m.double_sided);
  EXPECT_FALSE(m.unlit);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kOpaque);
  json_["samplers"][0] = {{"wrapS", 33071}, {"wrapT", 10497}};
  json_["materials"][0]["doubleSided"] = true;
  json_["materials"][0]["alphaMode"] = "MASK";
  json_["materials"][0]["extensions"]["KHR_materials_unlit"] = Json::object();
  const auto loaded = Load();
  m = loaded.mesh.materials[0];
  EXPECT_EQ(m.wrap, (std::array{TextureWrap::kClamp, TextureWrap::kRepeat}));
  EXPECT_TRUE(m.double_sided);
  EXPECT_TRUE(m.unlit);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(m.alpha_cutoff, 0.5f);
  EXPECT_TRUE(loaded.warnings.empty());
}

// KHR_texture_transform in glTF's coordinates: uv' = offset + R scale uv, R turning u towards -v.
TEST_F(GltfScene, TextureTransform) {
  Texture()["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25, 0.5}}, {"scale", {2, 3}}, {"rotation", 1.5707963267948966}};
  json_["extensionsUsed"] = json_["extensionsRequired"] = {"KHR_texture_transform"};
  const auto loaded = Load();
  EXPECT_TRUE(loaded.warnings.empty());
  const std::vector<glm::vec2> expected = {{0.25f, 0.5f}, {0.25f, 2.5f}, {3.25f, 0.5f}};
  ASSERT_EQ(loaded.mesh.corner_uvs.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT(glm::distance(loaded.mesh.corner_uvs[i], expected[i]), 1e-6) << i;
}

TEST_F(GltfScene, NonsenseInATransformIsIgnoredOrRefusedButNeverRead) {
  Texture()["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25}}, {"scale", "x"}, {"rotation", Json::array()}, {"texCoord", 0}};
  EXPECT_EQ(Load().mesh.corner_uvs.size(), 3u);
  Texture()["extensions"]["KHR_texture_transform"] = {{"offset", {1e39, 0}}};
  EXPECT_FALSE(io::LoadMesh(File()).ok());
}

TEST_F(GltfScene, MaterialsComeBackAsTheyWere) {
  Mesh mesh = Load().mesh;
  mesh.faces.resize(4, mesh.faces[0]);
  mesh.corner_uvs.resize(12, {0.5f, 0.5f});
  mesh.face_materials = {0, 1, 2, 3};
  mesh.textures.push_back({"second", ImageU8(2, 2, 4, 10)});
  const Material plain{.name = "a", .base_color = glm::vec4(1), .base_color_texture = 0};
  mesh.materials.assign(4, plain);
  mesh.materials[0].wrap = {TextureWrap::kMirror, TextureWrap::kClamp};
  mesh.materials[1].nearest = true;  // the same image, looked up otherwise
  mesh.materials[2] = {.name = "c", .base_color = {1, 1, 1, 0.5f}, .base_color_texture = 1};
  mesh.materials[2].alpha_mode = AlphaMode::kMask;
  mesh.materials[2].alpha_cutoff = 0.25f;
  mesh.materials[3] = {
      .name = "d", .base_color = glm::vec4(1), .double_sided = false, .unlit = true};
  const Path file = folder_ / "out.glb";
  ASSERT_TRUE(io::SaveGlb(file, mesh).ok());
  const auto loaded = Ok(io::LoadMesh(file));
  EXPECT_EQ(loaded->mesh.materials, mesh.materials);
  EXPECT_EQ(loaded->mesh.textures.size(), 2u);  // each image once
  EXPECT_TRUE(loaded->warnings.empty());
}

// The light's node turns +z, against which it shines, to the sun: also straight behind.
TEST_F(GltfScene, LightsPointToTheSun) {
  Mesh triangle;
  triangle.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle.faces = {{0, 1, 2}};
  for (const glm::dvec3& sun :
       {glm::dvec3(0, 0, 2), {0, 0, -1}, {1, 2, -3}, {-0.1, 0, -0.9}, {0, 1, 0}}) {
    const auto bytes = Ok(io::EncodeGlb(triangle, {.sun = sun}));
    std::uint32_t length = 0;
    std::memcpy(&length, bytes->data() + 12, 4);
    const Json scene = Json::parse(bytes->begin() + 20, bytes->begin() + 20 + length);
    const Json& q = scene["nodes"][1]["rotation"];
    const glm::dvec3 u(q[0], q[1], q[2]), z(0, 0, 1);
    const double w = q[3];
    const glm::dvec3 turned = z + 2.0 * glm::cross(u, glm::cross(u, z) + w * z);
    EXPECT_LT(glm::length(turned - sun / glm::length(sun)), 1e-6);
    Write("lit.glb", *bytes);
    const auto loaded = Ok(io::LoadMesh(folder_ / "lit.glb"));
    EXPECT_EQ(loaded->mesh.positions.size(), 3u);
  }
  EXPECT_FALSE(io::EncodeGlb(triangle, {.sun = glm::dvec3(0)}).ok());
  EXPECT_FALSE(io::EncodeGlb({}, {.sun = glm::dvec3(0, 1, 0)}).ok());
}

}  // namespace tilegrad::io::gltf_files_test

// SPDX-License-Identifier: Apache-2.0
// What glTF has beyond plain geometry: sparse accessors and such without a buffer view, morph
// targets, skins, specular-glossiness, and extensions that are not read.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "io/gltf_fixture.h"
#include "io/image_file.h"
#include "io/mesh_file.h"

namespace tilegrad::io::gltf_features_test {

// The triangle (0,0,0), (1,0,0), (0,1,0), and what a test adds to it.
class GltfFeatures : public GltfTest {
 protected:
  GltfFeatures() {
    Begin(R"({
      "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {}, "material": 0}]}], "materials": [{"name": "m"}],
      "bufferViews": [], "accessors": []})");
    Attributes()["POSITION"] = Add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  }
  Json& Primitive() { return json_["meshes"][0]["primitives"][0]; }
  Json& Attributes() { return Primitive()["attributes"]; }
  Json& Accessor(const char* attribute) {
    return json_["accessors"][Attributes()[attribute].get<std::size_t>()];
  }

  // Replaces vertices of the positions; `at` is of any width.
  template <class T>
  void MakeSparse(const std::vector<T>& at, const std::vector<float>& values) {
    const Json indices = {{"bufferView", AddView(at)},
                          {"componentType", sizeof(T) == 1 ? kByte : kShort}};
    Accessor("POSITION")["sparse"] = {
        {"count", at.size()}, {"indices", indices}, {"values", {{"bufferView", AddView(values)}}}};
  }
  LoadedMesh Load() { return Ok(LoadMesh(File())).value(); }
  std::vector<glm::vec3> Positions() { return Load().mesh.positions; }
  Status Error() { return LoadMesh(File()).status(); }
};

using Points = std::vector<glm::vec3>;

TEST_F(GltfFeatures, SparseAccessorsReplaceVertices) {
  MakeSparse<std::uint16_t>({0, 2}, {5, 6, 7, 8, 9, 10});
  EXPECT_EQ(Positions(), (Points{{5, 6, 7}, {1, 0, 0}, {8, 9, 10}}));
}

TEST_F(GltfFeatures, SparseAccessorsWithoutABaseReplaceZeros) {
  MakeSparse<std::uint8_t>({1, 2}, {5, 6, 7, 8, 9, 10});
  Accessor("POSITION").erase("bufferView");
  EXPECT_EQ(Positions(), (Points{{0, 0, 0}, {5, 6, 7}, {8, 9, 10}}));
}

TEST_F(GltfFeatures, SparseIndices) {
  Primitive()["indices"] = Add<std::uint16_t>("SCALAR", {0, 1, 2});
  json_["accessors"].back()["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", AddView<std::uint8_t>({1, 2})}, {"componentType", kByte}}},
      {"values", {{"bufferView", AddView<std::uint16_t>({2, 1})}}}};
  EXPECT_EQ(Load().mesh.faces, (std::vector<Face>{{0, 2, 1}}));
}

TEST_F(GltfFeatures, AccessorsWithoutABufferViewAreZeros) {
  json_["accessors"].push_back({{"componentType", kFloat}, {"count", 3}, {"type", "VEC3"}});
  Attributes()["COLOR_0"] = 1;
  EXPECT_EQ(Load().mesh.colors, (std::vector<glm::vec4>(3, {0, 0, 0, 1})));
  json_["accessors"][1]["type"] = "VEC4";
  json_["accessors"][1]["componentType"] = kByte;
  EXPECT_EQ(Load().mesh.colors, (std::vector<glm::vec4>(3, glm::vec4(0))));
}

TEST_F(GltfFeatures, WrongSparseNumbersAreErrors) {
  MakeSparse<std::uint16_t>({0, 3}, {5, 6, 7, 8, 9, 10});
  ExpectMessage(Error(), "a.gltf", "POSITION", "sparse", "index 1 is 3 of 3 elements");
  Json& sparse = Accessor("POSITION")["sparse"];
  const Json good = sparse;
  for (const auto& [place, value, message] :
       std::vector<std::tuple<const char*, Json, const char*>>{
           {"/count", 3, "beyond its buffer view"},
           {"/count", -1, "beyond its buffer view"},
           {"/count", 2147483647, "beyond its buffer view"},
           {"/indices/bufferView", 77, "buffer view 77 does not exist"},
           {"/indices/bufferView", -1, "buffer view -1 does not exist"},
           {"/indices/byteOffset", -4, "beyond its buffer view"},
           {"/indices/componentType", 5122, "unsigned"},
           {"/values/bufferView", -1, "does not exist"},
           {"/values/byteOffset", 4, "beyond its buffer view"}}) {
    SCOPED_TRACE(place);
    sparse = good;
    sparse[Json::json_pointer(place)] = value;
    ExpectMessage(Error(), "a.gltf", "sparse", message);
  }
}

// No file of a hundred bytes takes gigabytes.
TEST_F(GltfFeatures, ZerosAreLimited) {
  Accessor("POSITION").erase("bufferView");
  Accessor("POSITION")["count"] = 1'000'000'000'000;
  ExpectMessage(Error(), "a.gltf", "POSITION", "1000000000000 elements, but no buffer view");
}

TEST_F(GltfFeatures, DefaultMorphWeightsMoveVertices) {
  const int first = Add<float>("VEC3", {0, 0, 1, 0, 0, 2, 0, 0, 3});
  const int second = Add<float>("VEC3", {1, 0, 0, 1, 0, 0, 1, 0, 0});
  Primitive()["targets"] = {{{"POSITION", first}}, {{"POSITION", second}}};
  EXPECT_EQ(Positions()[1], glm::vec3(1, 0, 0));  // without weights
  json_["meshes"][0]["weights"] = {0.5, 2};
  EXPECT_EQ(Positions(), (Points{{2, 0, 0.5}, {3, 0, 1}, {2, 1, 1.5}}));
  json_["nodes"][0]["weights"] = {1};  // the node's own come first; the second is missing
  EXPECT_EQ(Positions(), (Points{{0, 0, 1}, {1, 0, 2}, {0, 1, 3}}));
}

TEST_F(GltfFeatures, MorphTargetsHaveNormalsAndColours) {
  Attributes()["NORMAL"] = Add<float>("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  Attributes()["COLOR_0"] = Add<float>("VEC3", {0, 0, 0, 0, 0, 0, 0, 0, 0});
  const int turn = Add<float>("VEC3", {0, 1, 0, 0, 1, -1, 0, 0, 0});
  const int paint = Add<float>("VEC3", {0.5f, 0, 0, 0, 1, 0, 0, 0, 0});
  Primitive()["targets"] = {{{"NORMAL", turn}, {"COLOR_0", paint}}};
  json_["meshes"][0]["weights"] = {1};
  const Mesh mesh = Load().mesh;
  EXPECT_LT(glm::distance(mesh.normals[0], glm::vec3(0, 0.70710678f, 0.70710678f)), 1e-6f);
  EXPECT_EQ(mesh.normals[1], glm::vec3(0, 1, 0));
  EXPECT_NEAR(mesh.colors[0].r, 0.735357f, 1e-5f);  // sRGB of 0.5
  EXPECT_EQ(mesh.colors[1], glm::vec4(0, 1, 0, 1));
}

TEST_F(GltfFeatures, WrongMorphTargetsAreErrors) {
  Primitive()["targets"] = {{{"POSITION", Add<float>("VEC3", {0, 0, 1})}}};
  EXPECT_TRUE(Error().ok());  // nothing asks for it
  json_["meshes"][0]["weights"] = {1};
  ExpectMessage(Error(), "a.gltf", "target 0", "POSITION", "1 elements for 3 vertices");
  Primitive()["targets"] = {{{"POSITION", 99}}};
  ExpectMessage(Error(), "a.gltf", "target 0", "accessor 99 does not exist");
}

// Two joints: one moved up by 2, the other, its child, turned a quarter about z.
class GltfSkins : public GltfFeatures {
 protected:
  GltfSkins() {
    json_["nodes"] = Json::parse(R"([
      {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
      {"translation": [0, 2, 0], "children": [2]},
      {"rotation": [0, 0, 0.70710678118654752, 0.70710678118654752]}])");
    json_["scenes"][0]["nodes"] = {0, 1};
    json_["skins"] = {{{"joints", {1, 2}}}};
    Attributes()["JOINTS_0"] = Add<std::uint8_t>("VEC4", {0, 9, 9, 9, 1, 0, 0, 0, 0, 1, 0, 0});
    Attributes()["WEIGHTS_0"] = Add<float>("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0});
  }
  void ExpectPositions(const Points& expected) {
    const Points got = Positions();
    ASSERT_EQ(got.size(), expected.size());
    for (std::size_t i = 0; i < got.size(); ++i)
      EXPECT_LT(glm::distance(got[i], expected[i]), 1e-6f) << i << ": " << got[i].x << got[i].y;
  }
};

// The node's own translation of 100 does not count. Vertex 0 goes up; 1 is turned to (0, 1), then
// up; 2 is half way between (0, 3) and (-1, 2).
TEST_F(GltfSkins, JointsPlaceTheVertices) {
  ExpectPositions({{0, 2, 0}, {0, 3, 0}, {-0.5f, 2.5f, 0}});
  Attributes()["NORMAL"] = Add<float>("VEC3", {0, 1, 0, 0, 1, 0, 0, 0, 1});
  const Mesh mesh = Load().mesh;
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 1, 0));
  EXPECT_LT(glm::distance(mesh.normals[1], glm::vec3(-1, 0, 0)), 1e-6f);
}

TEST_F(GltfSkins, InverseBindMatricesComeFirst) {
  std::vector<float> binds(32, 0.0f);
  for (const std::size_t k : {0, 5, 10, 15, 16, 21, 26, 31}) binds[k] = 1;
  binds[12] = 7;  // joint 0: x + 7
  json_["skins"][0]["inverseBindMatrices"] = Add<float>("MAT4", binds);
  ExpectPositions({{7, 2, 0}, {0, 3, 0}, {3, 2.5f, 0}});
}

// Weights of any sum, four more of them in a second set, and none at all: then the first joint.
TEST_F(GltfSkins, WeightsOfAnySum) {
  Attributes()["WEIGHTS_0"] = Add<float>("VEC4", {0, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0});
  Attributes()["JOINTS_1"] = Add<std::uint8_t>("VEC4", {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0});
  Attributes()["WEIGHTS_1"] = Add<float>("VEC4", {0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0});
  ExpectPositions({{0, 2, 0}, {0, 3, 0}, {-0.5f, 2.5f, 0}});
}

TEST_F(GltfSkins, AMeshWithoutJointsStandsAtItsNode) {
  Attributes().erase("JOINTS_0");
  Attributes().erase("WEIGHTS_0");
  ExpectPositions({{100, 0, 0}, {101, 0, 0}, {100, 1, 0}});
}

TEST_F(GltfSkins, WrongSkinsAreErrors) {
  const Json good = json_;
  for (const auto& [place, value, message] :
       std::vector<std::tuple<const char*, Json, const char*>>{
           {"/nodes/0/skin", 4, "skin 4 does not exist"},
           {"/skins/0/joints", {1}, "vertex 1 uses joint 1, but its skin has 1"},
           {"/skins/0/joints", {1, 8}, "node 8, a joint, does not exist"},
           {"/skins/0/inverseBindMatrices", 0, "expected 16 numbers"},
           {"/meshes/0/primitives/0/attributes/WEIGHTS_0", 0, "WEIGHTS_0: expected 4 numbers"},
           {"/nodes/2/children", {2}, ""}}) {
    SCOPED_TRACE(place);
    json_ = good;
    json_[Json::json_pointer(place)] = value;
    const Status status = Error();  // of a joint that is its own parent anything, but no hang
    if (*message != '\0') ExpectMessage(status, "a.gltf", message);
  }
  json_ = good;
  Attributes().erase("WEIGHTS_0");
  ExpectMessage(Error(), "a.gltf", "WEIGHTS_0");
}

TEST_F(GltfFeatures, SpecularGlossinessGivesItsDiffuseColourAndTexture) {
  EXPECT_TRUE(SavePng(folder_ / "t.png", ImageU8(2, 2, 3, 200)).ok());
  json_["images"] = {{{"uri", "t.png"}}};
  json_["samplers"] = {{{"wrapS", 33071}}};
  json_["textures"] = {{{"source", 0}, {"sampler", 0}}};
  json_["extensionsUsed"] = {"KHR_materials_pbrSpecularGlossiness"};
  json_["extensionsRequired"] = json_["extensionsUsed"];
  Attributes()["TEXCOORD_1"] = Add<float>("VEC2", {0, 0, 1, 0, 0, 1});
  json_["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {0, 0, 0, 1};  // not used
  Json& gloss = json_["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  gloss = {{"diffuseFactor", {1, 0.5, 0.25, 1}}};
  LoadedMesh loaded = Load();
  Material m = loaded.mesh.materials[0];
  EXPECT_TRUE(loaded.warnings.empty());
  EXPECT_LT(glm::distance(m.base_color, glm::vec4(1, 0.735357f, 0.537099f, 1)), 1e-5f);
  EXPECT_EQ(m.base_color_texture, -1);
  gloss["diffuseTexture"] = {{"index", 0}, {"texCoord", 1}};
  gloss["diffuseTexture"]["extensions"]["KHR_texture_transform"] = {{"offset", {0.25, 0.5}}};
  loaded = Load();
  m = loaded.mesh.materials[0];
  EXPECT_EQ(m.base_color_texture, 0);
  EXPECT_EQ(m.wrap[0], TextureWrap::kClamp);
  EXPECT_EQ(loaded.mesh.corner_uvs[1], glm::vec2(1.25f, 0.5f));
  gloss = {{"diffuseTexture", {{"index", "x"}, {"texCoord", json_["nodes"]}}},
           {"diffuseFactor", 1}};
  EXPECT_EQ(Load().mesh.materials[0].base_color_texture, -1);  // nonsense is not read
}

TEST_F(GltfFeatures, UnreadExtensionsAreOneWarning) {
  json_["extensionsUsed"] = {"KHR_materials_clearcoat", "KHR_texture_transform", "VENDOR_hair",
                             "KHR_materials_variants", "EXT_mesh_gpu_instancing"};
  json_["extensionsRequired"] = {"KHR_materials_clearcoat"};
  const auto warnings = Load().warnings;
  ExpectOnly(warnings, "KHR_materials_clearcoat, VENDOR_hair, EXT_mesh_gpu_instancing");
}

TEST_F(GltfFeatures, RequiredExtensionsThatAreNotReadAreErrors) {
  for (const char* name : {"EXT_mesh_gpu_instancing", "VENDOR_hair", "KHR_draco_mesh_compression",
                           "EXT_meshopt_compression"}) {
    json_["extensionsRequired"] = {name};
    ExpectMessage(Error(), "a.gltf", name);
  }
  ExpectMessage(Error(), "without compression");
}

// Also where they are not required, but the geometry is nowhere else.
TEST_F(GltfFeatures, CompressedGeometryIsAnErrorUnlessItIsThereUncompressed) {
  json_["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  Primitive()["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
  EXPECT_TRUE(Load().warnings.empty());
  Accessor("POSITION").erase("bufferView");
  ExpectMessage(Error(), "a.gltf", "KHR_draco_mesh_compression");
}

TEST_F(GltfFeatures, ImagesOfOtherFormatsGiveWayToTheTexturesOwn) {
  EXPECT_TRUE(SavePng(folder_ / "t.png", ImageU8(2, 2, 3, 200)).ok());
  Attributes()["TEXCOORD_0"] = Add<float>("VEC2", {0, 0, 1, 0, 0, 1});
  json_["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  json_["images"] = {{{"uri", "t.webp"}}, {{"uri", "t.png"}}};
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "EXT_texture_avif"}) {
    json_["textures"] = {{{"extensions", {{name, {{"source", 0}}}}}}};
    json_["extensionsUsed"] = {name};
    json_.erase("extensionsRequired");
    const LoadedMesh bare = Load();
    EXPECT_EQ(bare.mesh.materials[0].base_color_texture, -1);
    ExpectOnly(bare.warnings, name);
    json_["extensionsRequired"] = {name};
    ExpectMessage(Error(), "a.gltf", name, "PNG or JPEG");
    json_["textures"][0]["source"] = 1;
    const LoadedMesh fallback = Load();
    EXPECT_EQ(fallback.mesh.materials[0].base_color_texture, 0);
    EXPECT_TRUE(fallback.warnings.empty());
  }
}

TEST_F(GltfFeatures, WhatAMaterialHasAndIsNotDrawnWarnsOnce) {
  json_["materials"][0]["emissiveFactor"] = {0, 0.5, 0};
  Primitive()["targets"] = Json::array();
  json_["meshes"][0]["primitives"].push_back(Primitive());
  auto warnings = Load().warnings;
  ExpectOnly(warnings, "\"m\": its emission");
  json_["materials"][0].erase("emissiveFactor");
  EXPECT_TRUE(SavePng(folder_ / "t.png", ImageU8(2, 2, 3, 200)).ok());
  json_["images"] = {{{"uri", "t.png"}}};
  json_["textures"] = {{{"source", 0}}};
  json_["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0},
                                                                       {"texCoord", 3}};
  warnings = Load().warnings;
  ExpectOnly(warnings, "TEXCOORD_3");
}

}  // namespace tilegrad::io::gltf_features_test

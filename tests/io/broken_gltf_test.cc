// SPDX-License-Identifier: Apache-2.0
// Broken or hostile glTF and GLB give an error that names the file and the place. tinygltf passes
// on most numbers unchecked, so each kind of number is wrong once here.
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::broken_gltf_test {

using Json = nlohmann::json;

// A triangle with three indices: 36 bytes of positions, then 12 of indices, in one data URI.
Json Triangle() {
  Json json = Json::parse(R"({
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "buffers": [{"byteLength": 48}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                  {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"}]})");
  // Positions (0,0,0) (1,0,0) (0,1,0), indices 0 1 2.
  json["buffers"][0]["uri"] =
      "data:application/octet-stream;base64,"
      "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAEAAAACAAAA";
  return json;
}

class BrokenGltfTest : public TempFolderTest {
 protected:
  Status Load(const Json& json) { return LoadText(json.dump()); }
  Status LoadText(const std::string& text) { return LoadMesh(Write("bad.gltf", text)).status(); }
  Status LoadGlb(const Bytes& bytes) { return LoadMesh(Write("bad.glb", bytes)).status(); }
};

struct Edit {
  const char* place;
  Json value;
  std::vector<std::string> words = {};
};

// 2^64 - 12 plus an element of 12 bytes is 0: sums of offsets must not wrap.
TEST_F(BrokenGltfTest, NumbersAndReferencesThatAreWrong) {
  const std::string beyond = "beyond its buffer";
  const Edit edits[] = {{"/asset/version", "1.0", {"version \"1.0\""}},
                        {"/accessors/0/count", 2, {"index 2 is 2, but there are 2 vertices"}},
                        {"/accessors/0/count", 4, {"mesh 0 primitive 0", "POSITION", "4 elements"}},
                        {"/accessors/0/count", 1'000'000'000'000, {beyond + " view"}},
                        {"/accessors/0/byteOffset", 4, {beyond + " view"}},
                        {"/accessors/0/byteOffset", std::uint64_t(-12)},
                        {"/bufferViews/0/byteOffset", std::uint64_t(-12), {beyond}},
                        {"/bufferViews/0/byteOffset", 20, {beyond}},
                        {"/bufferViews/0/byteStride", 13},
                        {"/accessors/1/componentType", 5126, {"indices must be unsigned"}},
                        {"/accessors/0/componentType", 5125, {"not allowed in an attribute"}},
                        {"/accessors/0/type", "VEC2", {"expected 3 numbers"}},
                        {"/nodes/0/scale", {1e39, 1, 1}},
                        {"/meshes/0/primitives/0/attributes/POSITION", 7},
                        {"/meshes/0/primitives/0/attributes/POSITION", -1},
                        {"/meshes/0/primitives/0/indices", 9},
                        {"/accessors/0/bufferView", 5},
                        {"/accessors/1/bufferView", -3},
                        {"/bufferViews/0/buffer", 2},
                        {"/bufferViews/1/buffer", -2},
                        {"/nodes/0/mesh", 3},
                        {"/nodes/0/children", {4}},
                        {"/scenes/0/nodes", {11}},
                        {"/buffers/0/uri", "missing.bin"},
                        {"/buffers/0/byteLength", 4000000000u}};
  for (const Edit& edit : edits) {
    SCOPED_TRACE(edit.place + (" = " + edit.value.dump()));
    Json json = Triangle();
    json[Json::json_pointer(edit.place)] = edit.value;
    const Status status = Load(json);
    ExpectMessage(status, "bad.gltf");
    for (const std::string& word : edit.words) ExpectIn(status.message(), word);
  }
}

// What only colours need is a warning.
TEST_F(BrokenGltfTest, MaterialsAndTexturesThatAreNotThere) {
  const auto expect_one = [&](const Json& json, const std::string& part) {
    const auto loaded = Ok(LoadMesh(Write("a.gltf", json.dump())));
    ExpectOnly(loaded->warnings, part);
  };
  Json json = Triangle();
  json["meshes"][0]["primitives"][0]["material"] = 5;
  expect_one(json, "material 5 does not exist");
  json["meshes"][0]["primitives"][0]["material"] = 0;
  json["materials"] =
      Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}])");
  expect_one(json, "texture 3 does not exist");
  json["textures"] = Json::parse("[{}, {}, {}, {}]");
  expect_one(json, "texture 3 has no image");
  json["textures"][3]["source"] = 9;
  expect_one(json, "texture 3 has no image");
}

TEST_F(BrokenGltfTest, AttributesOfDifferentLengths) {
  Json json = Triangle();
  json["accessors"].push_back(
      {{"bufferView", 0}, {"componentType", 5126}, {"count", 2}, {"type", "VEC3"}});
  for (const char* key : {"NORMAL", "COLOR_0"}) {
    json["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", 0}, {key, 2}};
    ExpectMessage(Load(json), "bad.gltf", key, "2 elements for 3 vertices");
  }
}

TEST_F(BrokenGltfTest, NonFinitePosition) {
  Json json = Triangle();
  // The first number is a quiet NaN.
  json["buffers"][0]["uri"] =
      "data:application/octet-stream;base64,"
      "AADAfwAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAEAAAACAAAA";
  ExpectMessage(Load(json), "bad.gltf", "positions[0][0] is nan");
}

TEST_F(BrokenGltfTest, NodesThatAreNoTree) {
  Json json = Triangle();
  json["nodes"] = {{{"children", {0}}}};
  ExpectMessage(Load(json), "bad.gltf", "node 0 is reached twice");
  // Every node twice in the one above it: 2^60 paths.
  json["nodes"] = Json::array();
  for (int i = 1; i <= 60; ++i) json["nodes"].push_back({{"children", {i, i}}});
  json["nodes"].push_back({{"mesh", 0}});
  ExpectMessage(Load(json), "bad.gltf", "reached twice");
  json["nodes"] = Json::array();
  for (int i = 1; i <= 100000; ++i) json["nodes"].push_back({{"children", {i}}});
  json["nodes"].push_back({{"mesh", 0}});
  ExpectMessage(Load(json), "bad.gltf", "deep");
}

TEST_F(BrokenGltfTest, JsonThatIsBrokenOrTooDeep) {
  const std::string good = Triangle().dump();
  for (std::size_t length = 0; length < good.size(); length += 11)
    ExpectMessage(LoadText(good.substr(0, length)), "bad.gltf");
  ExpectMessage(LoadText("[1,2,3]"), "bad.gltf");
  ExpectMessage(LoadText("{\"asset\":\"\xff\xfe\"}"), "bad.gltf");
  // In "extras", where everything is allowed.
  const int deep = 1'000'000;
  ExpectMessage(LoadText(R"({"asset":{"version":"2.0"},"extras":)" + std::string(deep, '[') +
                         std::string(deep, ']') + "}"),
                "bad.gltf", "nested more than");
  // Brackets in a string are no nesting.
  Json json = Triangle();
  json["asset"]["copyright"] = std::string(1000, '[') + "\"";
  EXPECT_TRUE(Load(json).ok()) << Load(json).message();
}

// tinygltf quotes the whole of a buffer that it cannot decode.
TEST_F(BrokenGltfTest, MessagesAreShort) {
  Json json = Triangle();
  json["buffers"][0]["byteLength"] = 5000;
  json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + std::string(100000, 'A');
  const Status status = Load(json);
  ExpectMessage(status, "bad.gltf", "not valid glTF");
  EXPECT_LT(status.message().size(), 1000u);
}

TEST_F(BrokenGltfTest, VersionsThatA2Point0ReaderIsNotEnoughFor) {
  Json json = Triangle();
  json["asset"] = {{"version", "2.3"}, {"minVersion", "2.0"}};
  EXPECT_TRUE(Load(json).ok());
  json["asset"]["minVersion"] = "2.1";
  ExpectMessage(Load(json), "bad.gltf", "\"2.1\"");
  json["asset"]["minVersion"] = "3.0";
  ExpectMessage(Load(json), "bad.gltf", "\"3.0\"");
}

// An image whose place in the buffer is wrong costs the texture, not the mesh.
TEST_F(BrokenGltfTest, ImagesBeyondTheirBufferAreWarnings) {
  Json json = Triangle();
  json["meshes"][0]["primitives"][0]["material"] = 0;
  json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  json["textures"] = {{{"source", 0}}};
  json["images"] = {{{"bufferView", 2}, {"mimeType", "image/png"}, {"name", "photo"}}};
  for (const long length : {1000000000L, 3000000000L, 40L}) {
    json["bufferViews"][2] = {{"buffer", 0}, {"byteOffset", 40}, {"byteLength", length}};
    const auto loaded = Ok(LoadMesh(Write("image.gltf", json.dump())));
    ExpectOnly(loaded->warnings, "photo");
    ExpectIn(loaded->warnings[0], "beyond its buffer");
  }
}

// Found with a standard library that checks indices (_GLIBCXX_ASSERTIONS): tinygltf's reference to
// the first byte ended the program.
TEST_F(BrokenGltfTest, ImagesThatBeginBehindTheirBuffer) {
  Json json = Triangle();
  json["images"] = {{{"uri", "none.png"}}, {{"bufferView", 2}, {"mimeType", "image/png"}}};
  for (const std::uint64_t offset :
       {std::uint64_t{48}, std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
    json["bufferViews"][2] = {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", 1}};
    ExpectMessage(Load(json), "bad.gltf", "image 1", std::to_string(offset), "of 48 bytes");
  }
  json["bufferViews"][2]["byteOffset"] = 47;
  EXPECT_TRUE(Load(json).ok());
  // References to nowhere and of other types are tinygltf's to find.
  for (const Json& reference : {Json(3), Json(-2), Json(0.5), Json("a"), Json::array()}) {
    Json broken = json;
    broken["images"][1]["bufferView"] = reference;
    ExpectMessage(Load(broken), "bad.gltf", "not valid glTF");
    broken = json;
    broken["bufferViews"][2]["buffer"] = reference;
    ExpectMessage(Load(broken), "bad.gltf", "not valid glTF");
    broken = json;
    broken["images"] = reference;
    EXPECT_TRUE(Load(broken).ok());
  }
}

Mesh TexturedBox() {
  Mesh mesh = Box({0, 0, 0}, {1, 2, 3});
  SetColor(mesh, {0.25f, 0.5f, 0.75f, 1});
  mesh.corner_uvs.assign(3 * mesh.faces.size(), {0.25f, 0.5f});
  mesh.materials = {{.name = "image", .base_color = glm::vec4(1), .base_color_texture = 0}};
  mesh.textures = {{"grey", ImageU8(4, 4, 3, 128)}};
  return mesh;
}

TEST_F(BrokenGltfTest, GlbCutOrWithLyingLengths) {
  const Bytes whole = EncodeGlb(TexturedBox()).value();
  ExpectCutsRefused(std::span(whole).first(64), "bad.glb",
                    [&](const Bytes& cut) { return LoadGlb(cut); });
  ExpectCutsRefused(
      whole, "bad.glb", [&](const Bytes& cut) { return LoadGlb(cut); }, 61);
  std::uint32_t json_length = 0;
  std::memcpy(&json_length, &whole[12], 4);
  // Length of the file, of the JSON chunk, of the binary chunk.
  for (const std::size_t at : {std::size_t{8}, std::size_t{12}, std::size_t{20} + json_length}) {
    for (const std::uint32_t lie : {0u, 1u, 0x7fffffffu, 0xfffffff0u, 0xffffffffu}) {
      Bytes broken = whole;
      std::memcpy(&broken[at], &lie, 4);
      SCOPED_TRACE(testing::Message() << "at " << at << ": " << lie);
      ExpectMessage(LoadGlb(broken), "bad.glb");
    }
  }
}

}  // namespace tilegrad::io::broken_gltf_test

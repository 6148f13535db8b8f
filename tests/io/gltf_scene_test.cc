// SPDX-License-Identifier: Apache-2.0
// glTF beyond geometry: cameras, samplers, texture transforms, how materials are drawn.
#include <gtest/gtest.h>

#include <cstring>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "io/glb_writer.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::gltf_scene_test {

using nlohmann::json;

// One triangle with uv (0,0), (1,0), (0,1), a material with a texture, a camera on a node.
constexpr std::array kMirrored = {TextureWrap::kMirror, TextureWrap::kMirror};

class GltfScene : public TempFolderTest {
 protected:
  GltfScene() {
    const std::vector<float> numbers = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1};
    Write("a.bin", std::string(reinterpret_cast<const char*>(numbers.data()), 60));
    EXPECT_TRUE(io::SavePng(folder_ / "t.png", ImageU8(2, 2, 3, 200)).ok());
    scene_ = json::parse(R"({
      "asset": {"version": "2.0"},
      "scenes": [{"nodes": [0, 1]}], "scene": 0,
      "nodes": [{"mesh": 0},
                {"camera": 0, "name": "eye", "translation": [1, 2, 3], "scale": [2, 2, 2]}],
      "cameras": [{"type": "perspective",
                   "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.25}}],
      "buffers": [{"uri": "a.bin", "byteLength": 60}],
      "bufferViews": [{"buffer": 0, "byteLength": 36},
                      {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                    {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
      "images": [{"uri": "t.png"}],
      "samplers": [{"wrapS": 33648, "wrapT": 33648, "magFilter": 9728}],
      "textures": [{"source": 0, "sampler": 0}],
      "materials": [{"name": "m", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                                  "material": 0}]}]})");
  }
  io::LoadedMesh Load() { return Ok(io::LoadMesh(Write("a.gltf", scene_.dump()))).value(); }
  json& Texture() { return scene_["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]; }
  json scene_;
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
  scene_["cameras"][0] = {{"type", "orthographic"},
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
  scene_["samplers"][0] = {{"wrapS", 33071}, {"wrapT", 10497}};
  scene_["materials"][0]["doubleSided"] = true;
  scene_["materials"][0]["alphaMode"] = "MASK";
  scene_["materials"][0]["extensions"]["KHR_materials_unlit"] = json::object();
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
  scene_["extensionsUsed"] = scene_["extensionsRequired"] = {"KHR_texture_transform"};
  const auto loaded = Load();
  EXPECT_TRUE(loaded.warnings.empty());
  const std::vector<glm::vec2> expected = {{0.25f, 0.5f}, {0.25f, 2.5f}, {3.25f, 0.5f}};
  ASSERT_EQ(loaded.mesh.corner_uvs.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT(glm::distance(loaded.mesh.corner_uvs[i], expected[i]), 1e-6) << i;
}

TEST_F(GltfScene, NonsenseInATransformIsIgnoredOrRefusedButNeverRead) {
  Texture()["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25}}, {"scale", "x"}, {"rotation", json::array()}, {"texCoord", 0}};
  EXPECT_EQ(Load().mesh.corner_uvs.size(), 3u);
  Texture()["extensions"]["KHR_texture_transform"] = {{"offset", {1e39, 0}}};
  EXPECT_FALSE(io::LoadMesh(Write("a.gltf", scene_.dump())).ok());
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
    const json scene = json::parse(bytes->begin() + 20, bytes->begin() + 20 + length);
    const json& q = scene["nodes"][1]["rotation"];
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

}  // namespace tilegrad::gltf_scene_test

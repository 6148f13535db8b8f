// SPDX-License-Identifier: Apache-2.0
// Colours that a file counts to 255 or 65535, where its format wants fractions: of vertices and
// materials, in each format. And what no reader may do with others.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "io/gltf_fixture.h"
#include "io/mesh_file.h"
#include "scene/image.h"

namespace tilegrad::io::counted_colors_test {

const glm::vec4 kOrange(1, 128 / 255.0f, 0, 1), kWhite(1);

void ExpectNear(const glm::vec4& got, const glm::vec4& want) {
  EXPECT_LT(glm::distance(got, want), 1e-6f)
      << got.r << " " << got.g << " " << got.b << " " << got.a;
}

class CountedColors : public GltfTest {
 protected:
  // With one warning that has `said`; "" for none.
  Mesh Load(const Path& path, const std::string& said) {
    SCOPED_TRACE(path);
    auto loaded = Ok(LoadMesh(path));
    EXPECT_EQ(loaded->warnings.size(), said.empty() ? 0u : 1u);
    for (const std::string& warning : loaded->warnings) ExpectIn(warning, said);
    return std::move(loaded->mesh);
  }

  // A triangle for each list of nine or twelve numbers; an empty one: without colours.
  template <class T>
  Path Gltf(const std::vector<std::vector<T>>& colors, bool normalized,
            const Json& factor = {1, 1, 1, 1}) {
    Begin(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
              "nodes": [{"mesh": 0}], "bufferViews": [], "accessors": []})");
    const int place = Add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
    json_["materials"] = {{{"name", "m"}, {"pbrMetallicRoughness", {{"baseColorFactor", factor}}}}};
    json_["meshes"] = {{{"primitives", Json::array()}}};
    for (const std::vector<T>& list : colors) {
      Json primitive = {{"attributes", {{"POSITION", place}}}, {"material", 0}};
      if (!list.empty()) {
        primitive["attributes"]["COLOR_0"] = Add(list.size() == 12 ? "VEC4" : "VEC3", list);
        if (normalized) json_["accessors"].back()["normalized"] = true;
      }
      json_["meshes"][0]["primitives"].push_back(primitive);
    }
    return File();
  }
};

// Bytes of four numbers a vertex, to keep glTF's alignment.
std::vector<std::uint8_t> OrangeBytes() {
  return {255, 128, 0, 255, 255, 128, 0, 255, 255, 128, 0, 255};
}
std::vector<float> OrangeFloats() { return {255, 128, 0, 255, 128, 0, 255, 128, 0}; }

TEST_F(CountedColors, OfGltfThatAreNotNormalised) {
  const Mesh bytes = Load(Gltf<std::uint8_t>({OrangeBytes()}, false), "read as 0 to 255");
  ASSERT_EQ(bytes.colors.size(), 3u);
  for (const glm::vec4& color : bytes.colors) ExpectNear(color, kOrange);
  const std::uint16_t full = 65535, half = 128 * 257;
  const std::vector<std::uint16_t> shorts = {full, half, 0,    full, full, half,
                                             0,    full, full, half, 0,    full};
  const Mesh words = Load(Gltf<std::uint16_t>({shorts}, false), "read as 0 to 65535");
  for (const glm::vec4& color : words.colors) ExpectNear(color, kOrange);
  // As the format has it: linear.
  const Mesh plain = Load(Gltf<std::uint8_t>({OrangeBytes()}, true), "");
  for (const glm::vec4& color : plain.colors)
    ExpectNear(color, {1, LinearToSrgb(128 / 255.0f), 0, 1});
  EXPECT_NEAR(plain.colors.at(0).g, 0.735, 0.003);
}

TEST_F(CountedColors, OfGltfAsFractions) {
  for (const glm::vec4& color :
       Load(Gltf<float>({OrangeFloats()}, false), "read as 0 to 255").colors)
    ExpectNear(color, kOrange);
  std::vector<float> alpha;
  for (int v = 0; v < 3; ++v) alpha.insert(alpha.end(), {255, 128, 0, 51});
  ExpectNear(Load(Gltf<float>({alpha}, false), "0 to 255").colors.at(0),
             {1, 128 / 255.0f, 0, 0.2f});
  const Mesh light = Load(Gltf<float>({{0.5f, 0, 1, 0.5f, 0, 1, 0.5f, 0, 1}}, false), "");
  ExpectNear(light.colors.at(0), {LinearToSrgb(0.5f), 0, 1, 1});
  const Mesh bright = Load(Gltf<float>({{1.5f, 0.5f, 0, 0, 0, 0, 0, 0, 0}}, false), "cut to 1");
  ExpectNear(bright.colors.at(0), {1, LinearToSrgb(0.5f), 0, 1});
}

// A part without colours is white beside one that counts to 255, not black.
TEST_F(CountedColors, OfOnePartOnly) {
  const Mesh mesh =
      Load(Gltf<float>({OrangeFloats(), {}, {0.5f, 0, 1, 0.5f, 0, 1, 0.5f, 0, 1}}, false),
           "read as 0 to 255");
  ASSERT_EQ(mesh.colors.size(), 9u);
  ExpectNear(mesh.colors[0], kOrange);
  ExpectNear(mesh.colors[3], kWhite);
  ExpectNear(mesh.colors[6], {LinearToSrgb(0.5f), 0, 1, 1});
}

TEST_F(CountedColors, OfTextFormats) {
  const auto ply = [](const std::string& type) {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
           "float z\nproperty " +
           type + " red\nproperty " + type + " green\nproperty " + type +
           " blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
           "0 0 0 255 128 0\n1 0 0 255 128 0\n0 1 0 255 128 0\n3 0 1 2\n";
  };
  const std::string counted = "read as 0 to 255";
  for (const auto& [name, text, said] : std::vector<std::array<std::string, 3>>{
           {"uchar.ply", ply("uchar"), ""},
           {"float.ply", ply("float"), counted},
           {"double.ply", ply("double"), counted},
           {"int.ply", ply("int"), counted},
           {"a.obj", "v 0 0 0 255 128 0\nv 1 0 0 255 128 0\nv 0 1 0 255 128 0\nf 1 2 3\n", counted},
           {"b.obj", "v 0 0 0 255.0 128.0 0.0\nv 1 0 0 255 128 0\nv 0 1 0 255 128 0\nf 1 2 3\n",
            counted},
           {"a.off", "COFF\n3 1 0\n0 0 0 255 128 0\n1 0 0 255 128 0\n0 1 0 255 128 0\n3 0 1 2\n",
            ""},
           {"b.off",
            "COFF\n3 1 0\n0 0 0 255.0 128.0 0.0\n1 0 0 255.0 128.0 0.0\n0 1 0 255.0 128.0 0.0\n3 0 "
            "1 2\n",
            counted}}) {
    const Mesh mesh = Load(Write(name, text), said);
    ASSERT_EQ(mesh.colors.size(), 3u) << name;
    for (const glm::vec4& color : mesh.colors) ExpectNear(color, kOrange);
  }
}

TEST_F(CountedColors, OfSomeVerticesAndOfSixteenBits) {
  const Mesh some =
      Load(Write("a.obj", "v 0 0 0\nv 1 0 0 255 128 0\nv 0 1 0 1 1 1\nf 1 2 3\n"), "0 to 255");
  ExpectNear(some.colors.at(0), kWhite);  // it has none
  ExpectNear(some.colors.at(1), kOrange);
  ExpectNear(some.colors.at(2), {1 / 255.0f, 1 / 255.0f, 1 / 255.0f, 1});
  const Mesh words =
      Load(Write("b.obj", "v 0 0 0 65535 32896 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n"),
           "0 to 65535");
  ExpectNear(words.colors.at(0), kOrange);
}

TEST_F(CountedColors, OfMaterials) {
  Write("m.mtl", "newmtl a\nKd 255 128 0\nnewmtl b\nKd 51 51 51\nnewmtl c\nKd 1 0 0.5\n");
  const auto loaded = Ok(LoadMesh(
      Write("a.obj",
            "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl "
            "c\nf 1 2 3\n")));
  ExpectNear(loaded->mesh.materials.at(0).base_color, kOrange);
  ExpectNear(loaded->mesh.materials.at(1).base_color, {0.2f, 0.2f, 0.2f, 1});
  ExpectNear(loaded->mesh.materials.at(2).base_color, {1, 0, 0.5f, 1});
  ASSERT_EQ(loaded->warnings.size(), 2u);
  EXPECT_EQ(loaded->warnings[0], "material \"a\": its colour (255, 128, 0) is read as 0 to 255");
  const Json factor = {255, 128, 0, 1};
  const Mesh mesh = Load(Gltf<float>({{}}, false, factor), "(255, 128, 0) is read as");
  ExpectNear(mesh.materials.at(0).base_color, kOrange);
}

// In the file's own numbers, not those that sRGB makes of them.
TEST_F(CountedColors, WarningsHaveTheFilesNumbers) {
  const Mesh mesh = Load(Gltf<float>({{}}, false, {2, 0.5, 0.25, 1}),
                         "material \"m\": its colour (2, 0.5, 0.25) is cut to 1");
  ExpectNear(mesh.materials.at(0).base_color, {1, LinearToSrgb(0.5f), LinearToSrgb(0.25f), 1});
}

// What is no number is an error as ever, not a white counted to 255.
TEST_F(CountedColors, ThatAreNotFiniteAreErrors) {
  const float inf = std::numeric_limits<float>::infinity();
  for (const float bad : {inf, -inf, std::numeric_limits<float>::quiet_NaN()}) {
    const Path path = Gltf<float>({{255, bad, 0, 255, 128, 0, 255, 128, 0}}, false);
    ExpectMessage(LoadMesh(path).status(), "a.gltf", "colors");
  }
}

}  // namespace tilegrad::io::counted_colors_test

// SPDX-License-Identifier: Apache-2.0
// Materials with numbers that are none, or too large: whoever reads or writes them says so.
#include <gtest/gtest.h>

#include <limits>

#include "io/glb_writer.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::hostile_materials_test {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kMost = std::numeric_limits<float>::max();

Mesh Painted(glm::vec4 color) {
  Mesh mesh = Icosphere(0, 1);
  mesh.materials = {{.name = "paint", .base_color = color}};
  return mesh;
}

class HostileMaterials : public TempFolderTest {
 protected:
  // An error that names the file and the material (or, of MTL, the line), or a warning that does,
  // and sound colours.
  void ExpectNamed(const Path& file) {
    const auto loaded = LoadMesh(file);
    if (!loaded.ok() && file.extension() == ".obj") {
      return ExpectMessage(loaded.status(), "a.mtl: line 2", "finite");
    }
    if (!loaded.ok()) return ExpectMessage(loaded.status(), file.filename().string(), "paint");
    bool named = false;
    for (const std::string& warning : loaded->warnings) {
      named |= warning.find("paint") != std::string::npos;
    }
    EXPECT_TRUE(named) << file;
    EXPECT_TRUE(Validate(loaded->mesh).ok());
  }

  // A GLB whose n-th number of the base colour, counted from 0, is `number`.
  Path GlbWithFactor(int n, std::string number) {
    Mesh mesh = Painted({0.3f, 0.4f, 0.6f, 0.7f});
    const Bytes bytes = EncodeGlb(mesh).value();
    std::string text(bytes.begin(), bytes.end());
    std::size_t at = text.find("baseColorFactor\":[") + 18;
    for (; n > 0; --n) at = text.find(',', at) + 1;
    const std::size_t length = text.find_first_of(",]", at) - at;
    number.resize(length, ' ');
    return Write("factor.glb", text.replace(at, length, number));
  }
};

TEST_F(HostileMaterials, OfObjFilesAreNamed) {
  for (const char* line : {"Kd nan 0 0", "Kd 0 inf 0", "Kd 0 0 1e39", "d nan", "d -nan"}) {
    SCOPED_TRACE(line);
    Write("a.mtl", std::string("newmtl paint\n") + line + "\n");
    ExpectNamed(Write("a.obj", "mtllib a.mtl\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  }
}

// Other formats name the line; OFF has no word for a colour that is none, and leaves it out.
TEST_F(HostileMaterials, OfOtherFormatsAreNamed) {
  const std::string object =
      "OBJECT poly\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x0\nmat 0\nrefs 3\n0 0 0\n"
      "1 0 0\n2 0 0\nkids 0\n";
  for (const char* numbers : {"rgb nan 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0",
                              "rgb 1e39 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0",
                              "rgb 1 0 0 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans -inf"}) {
    const Path file =
        Write("a.ac", std::string("AC3Db\nMATERIAL \"m\" ") + numbers + "\n" + object);
    ExpectMessage(LoadMesh(file).status(), "a.ac: line 2", "finite");
  }
  const std::string corners = "v 0 0 0 nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  ExpectMessage(LoadMesh(Write("a.obj", corners)).status(), "a.obj: line 1", "finite");
  for (const char* color : {"nan 0 0", "0 inf 0 1", "1e39 0 0"}) {
    const auto loaded = LoadMesh(
        Write("a.off", std::string("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 ") + color + "\n"));
    ASSERT_TRUE(loaded.ok()) << loaded.status().message();
    EXPECT_TRUE(loaded->mesh.corner_colors.empty());
    EXPECT_EQ(loaded->warnings.size(), 1u);
  }
}

TEST_F(HostileMaterials, OfGltfFilesAreNamed) {
  ASSERT_TRUE(LoadMesh(GlbWithFactor(0, "0.25")).ok());
  for (const char* number : {"1e39", "-1e39", "1e300"}) {
    for (const int n : {0, 2, 3}) {
      SCOPED_TRACE(number);
      ExpectNamed(GlbWithFactor(n, number));
    }
  }
}

TEST_F(HostileMaterials, AreNotSavedAsWhite) {
  const Path file = folder_ / "out.glb";
  for (const float bad : {kNan, kInf, -kInf, kMost}) {
    ExpectMessage(SaveGlb(file, Painted({1, bad, 1, 1})), "materials[0]", "paint", "base_color");
  }
  ExpectMessage(SaveGlb(file, Painted({1, 1, 1, kNan})), "paint", "base_color[3]");
  Mesh mesh = Painted({1, 1, 1, 1});
  mesh.colors.assign(mesh.positions.size(), {1, 1, 1, 1});
  mesh.colors[3].g = kMost;
  ExpectMessage(SaveGlb(file, mesh), "colors[3]", "too large");
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace tilegrad::io::hostile_materials_test

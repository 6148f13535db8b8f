// SPDX-License-Identifier: Apache-2.0
// MD2 and its skins.
#include <gtest/gtest.h>

#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/mesh_samples.h"
#include "support/temp_folder.h"

namespace tilegrad::io::md2_test {

class Md2Test : public TempFolderTest {
 protected:
  void SetUp() override { ASSERT_TRUE(SavePng(folder_ / "red.png", ImageU8(4, 2, 3, 50)).ok()); }
  LoadedMesh Load(const std::string& skin) {
    auto loaded = LoadMesh(Write("a.md2", Md2Sample(skin)));
    EXPECT_TRUE(loaded.ok()) << loaded.status().message();
    return loaded.ok() ? std::move(*loaded) : LoadedMesh();
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
  ASSERT_EQ(none.warnings.size(), 1u);
  EXPECT_NE(none.warnings[0].find(".blue"), std::string::npos);
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

}  // namespace tilegrad::io::md2_test

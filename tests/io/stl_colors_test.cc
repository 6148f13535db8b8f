// SPDX-License-Identifier: Apache-2.0
// The colours that Magics and VisCAM keep in the two bytes behind a facet of binary STL.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::stl_colors_test {

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
    const auto loaded = LoadMesh(File(header, attributes));
    ASSERT_TRUE(loaded.ok()) << loaded.status().message();
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

TEST_F(StlColors, TextIsLeftAsItIs) {
  std::string text = "solid COLOR=1\nfacet normal 0 0 1\nouter loop\n";
  text += "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid COLOR=1\n";
  const auto loaded = LoadMesh(Write("a.stl", text));
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->mesh.faces.size(), 1u);
}

}  // namespace tilegrad::io::stl_colors_test

// SPDX-License-Identifier: Apache-2.0
// Each format that Assimp reads for us: a sound file gives its mesh. Damaged ones: the fuzz target
// `assimp`.
#include <gtest/gtest.h>

#include <algorithm>

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
  const auto loaded = LoadMesh(Write("a.x",
                                     "xof 0303txt 0032\nMesh t {\n"
                                     "4;\n0;0;0;,1;0;0;,0;2;0;,0;0;3;;\n"
                                     "3;\n3;0,2,1;,0;,3;0,1,3;;\n}\n"));
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->mesh.faces.size(), 2u);
}

TEST_F(AssimpFormatsTest, UnknownEndingsNameTheKnownOnes) {
  ExpectMessage(LoadMesh(Write("a.max", "x")).status(), "a.max", "\".max\"", ".glb, .gltf, .obj",
                ".fbx", ".ms3d", ".md2");
}

}  // namespace tilegrad::io::assimp_formats_test

// SPDX-License-Identifier: Apache-2.0
// The scene sent by the importing process: round trip, and arbitrary bytes.
#include "io/imported_scene.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/temp_folder.h"

namespace tilegrad::io::imported_scene_test {

ImportedScene Scene() {
  ImportedScene scene;
  ImportedPart part;
  part.name = "part";
  part.positions = part.normals = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  part.uvs.resize(3);
  part.colors.resize(3, glm::vec4(1));
  part.triangles = {{0, 1, 2}};
  scene.parts = {part};
  scene.materials = {{"m", glm::vec4(0.5f), "image.png", 0, ""}};
  scene.images = {{"image.png", Bytes(20, 3)}};
  scene.instances = {{0, glm::dmat4x3(2)}};
  scene.warnings = {"left out"};
  return scene;
}

Status Decode(const ImportedScene& scene) { return DecodeScene(EncodeScene(scene)).status(); }

TEST(ImportedScene, RoundTrip) {
  const auto back = DecodeScene(EncodeScene(Scene()));
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ(back->parts[0].positions, Scene().parts[0].positions);
  EXPECT_EQ(back->parts[0].triangles, Scene().parts[0].triangles);
  EXPECT_EQ(back->materials[0].image, "image.png");
  EXPECT_EQ(back->images[0].bytes, Bytes(20, 3));
  EXPECT_EQ(back->instances[0].to_scene, glm::dmat4x3(2));
  EXPECT_EQ(back->warnings, Scene().warnings);
}

TEST(ImportedScene, ErrorsAreHandedOver) {
  ExpectMessage(DecodeScene(EncodeScene(DataLoss("line 3"))).status(), "line 3");
  ExpectMessage(DecodeScene(EncodeScene(DataLoss(""))).status(), "not whole");
}

TEST(ImportedScene, IndicesAndCountsAreChecked) {
  ImportedScene scene = Scene();
  scene.parts[0].triangles[0][2] = 3;
  ExpectMessage(Decode(scene), "vertex 3 of 3");
  scene = Scene();
  scene.parts[0].uvs.pop_back();
  ExpectMessage(Decode(scene), "2 attributes for 3 vertices");
  scene = Scene();
  scene.instances[0].part = 1;
  ExpectMessage(Decode(scene), "part 1 of 1");
  for (const int image : {1, -2}) {
    scene = Scene();
    scene.materials[0].embedded = image;
    ExpectMessage(Decode(scene), "image", "of 1");
  }
}

TEST(ImportedScene, CutBytesAreErrors) {
  const Bytes whole = EncodeScene(Scene());
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_FALSE(DecodeScene({whole.data(), length}).ok()) << length;
}

}  // namespace tilegrad::io::imported_scene_test

// SPDX-License-Identifier: Apache-2.0
// What only the command of a fit does.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::fit_command_test {

using Json = nlohmann::json;

// As a place (x, y, z) of glTF stands in a world whose z points up.
glm::vec3 WithZUp(glm::vec3 p) { return {p.x, -p.z, p.y}; }

class FitCommand : public ProgramTest {
 protected:
  // Views of a flat box in such a world, as NeRF's synthetic scenes have them, and the box itself
  // as box.obj.
  void MakeWorld() {
    const Mesh box = Box({0, 0, 0}, {0.9f, 0.36f, 0.63f});
    ASSERT_TRUE(io::SaveGlb(folder_ / "box.glb", box).ok());
    ExpectDone("views " + In("box.glb") + " --views 8 --held-out 0 --size 48 --out " + In("v"));
    const Path file = folder_ / "v/transforms_train.json";
    Json json = Json::parse(ReadText(file).value());
    for (Json& frame : json.at("frames")) {
      Json& rows = frame.at("transform_matrix");  // to the world
      std::swap(rows[1], rows[2]);
      for (Json& number : rows[1]) number = -number.get<double>();
    }
    Write("v/transforms_train.json", json.dump());
    Write("box.obj", ObjText(box, WithZUp));
  }

  struct Fitted {
    glm::vec3 size;
    double iou = 0, to_truth = 0;
    std::string said;
  };
  Fitted FitBox(const std::string& options) {
    Fitted out;
    const Outcome done =
        RunProgram("fit " + In("v") + " --start " + In("box.obj") + " --truth " +
                   In("v/truth.glb") + " --steps 1 --json --force --out " + In("f") + options);
    EXPECT_EQ(done.exit_code, 0) << done.output;
    if (done.exit_code != 0) return out;
    const auto begin = done.output.find('{');
    const Json json = Json::parse(done.output.substr(begin));
    const auto mesh = io::LoadMesh(folder_ / "f/mesh.glb");
    const Bounds bounds = MeshBounds(mesh.value().mesh);
    return {bounds.high - bounds.low, json["training"]["silhouette_iou"], json["voxel_iou"],
            done.output.substr(0, begin)};
  }
};

TEST_F(FitCommand, TurnsWorldsOfOtherAxesUpright) {
  MakeWorld();
  for (const char* options : {"", " --up z"}) {
    const Fitted turned = FitBox(options);
    EXPECT_NEAR(turned.size.y, 0.36, 0.05) << options;
    EXPECT_NEAR(turned.size.z, 0.63, 0.05) << options;
    EXPECT_GT(turned.iou, 0.85) << options;
    EXPECT_GT(turned.to_truth, 0.8) << options;
    // It is said where nobody has asked for it.
    EXPECT_EQ(turned.said.find("upright if z points up") != std::string::npos, *options == '\0')
        << turned.said;
  }
  const Fitted lying = FitBox(" --up y");
  EXPECT_NEAR(lying.size.y, 0.63, 0.05);
  EXPECT_NEAR(lying.size.z, 0.36, 0.05);
  EXPECT_GT(lying.iou, 0.85);
  EXPECT_LT(lying.to_truth, 0.6);  // glTF has y up
}

// A wrong camera, which the others outvote; and what is given in vain.
TEST_F(FitCommand, SaysWhatIsInDoubt) {
  MakeWorld();
  ExpectNotIn(FitBox("").said, "mesh and mask", "--fov has");
  const Path file = folder_ / "v/transforms_train.json";
  Json json = Json::parse(ReadText(file).value());
  Json& first = json.at("frames").at(0).at("transform_matrix");
  for (std::size_t row = 0; row < 3; ++row) {
    const double right = first[row][0].get<double>();
    first[row][3] = first[row][3].get<double>() + 0.5 * right;
  }
  Write("v/transforms_train.json", json.dump());
  ExpectIn(FitBox(" --fov 50").said, "warning: 000.png: mesh and mask agree to ",
           "--fov has no effect");
}

}  // namespace tilegrad::fit_command_test

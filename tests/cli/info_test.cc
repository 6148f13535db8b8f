// SPDX-License-Identifier: Apache-2.0
// tilegrad info: what it says of instruction sets holds for the program.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/simd_target.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::info_test {

// The rest of the line behind `start`.
std::string LineBehind(const std::string& text, const std::string& start) {
  const std::size_t from = text.find(start);
  EXPECT_NE(from, std::string::npos) << start << " is not in: " << text;
  if (from == std::string::npos) return "";
  return text.substr(from + start.size(), text.find('\n', from) - from - start.size());
}

class InfoCommand : public ProgramTest {
 protected:
  nlohmann::json Described(const std::string& files) const {
    return nlohmann::json::parse(ExpectDone("info --json " + files));
  }
};

TEST_F(InfoCommand, TakesTheBestTargetUnlessOneIsForced) {
  ::unsetenv("TILEGRAD_TARGET");
  std::istringstream targets(LineBehind(ExpectDone("info"), "best first: "));
  std::string best;
  targets >> best;
  std::string target = best;
  EXPECT_EQ(LineBehind(ExpectDone("info"), "in use: ").rfind(best + " (the best", 0), 0u)
      << ExpectDone("info");
  while (targets >> target) {
    ::setenv("TILEGRAD_TARGET", target.c_str(), 1);
    EXPECT_EQ(LineBehind(ExpectDone("info"), "in use: "), target + " (forced by TILEGRAD_TARGET)");
  }
  EXPECT_EQ(target, RunnableTargets().back());
  ::unsetenv("TILEGRAD_TARGET");
}

TEST_F(InfoCommand, SaysWhatAFileHolds) {
  ASSERT_TRUE(io::SavePng(folder_ / "wood.png", ImageU8(4, 2, 3)).ok());
  Write("wood.mtl", "newmtl wood\nmap_Kd wood.png\nnewmtl steel\nKd 1 1 1\n");
  Write("a.obj",
        "mtllib wood.mtl\nv 10 0 0\nv 12 0 0\nv 10 1 0\nv 10 0 -3\n"
        "vt 0 0\nvt 1 0\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3\n"
        "usemtl steel\nf 1 2 4\n");
  const auto mesh = Described(In("a.obj"))[0];
  EXPECT_EQ(mesh["vertices"], 4);
  EXPECT_EQ(mesh["faces"], 2);
  EXPECT_EQ(mesh["low"], (std::vector<double>{10, 0, -3}));
  EXPECT_EQ(mesh["high"], (std::vector<double>{12, 1, 0}));
  EXPECT_EQ(mesh["materials"], (std::vector<std::string>{"wood", "steel"}));
  EXPECT_EQ(mesh["textures"].size(), 1u);
  EXPECT_EQ(mesh["textures"][0]["width"], 4);
  EXPECT_EQ(mesh["textures"][0]["height"], 2);
  EXPECT_EQ(mesh["watertight"], false);
  EXPECT_EQ(mesh["edges_of_one_face"], 4);
  const Outcome said = RunProgram("info " + In("a.obj"));
  for (const char* part : {"vertices: 4\n", "faces: 2\n", "extent: 2 x 1 x 3, from (10, 0, -3)",
                           "materials: 2: \"wood\", \"steel\"\n", "4 x 2 pixels\n",
                           "watertight: no: 4 edges of one face, 0 of more than two\n"})
    EXPECT_NE(said.output.find(part), std::string::npos) << part << said.output;
}

// By place: a cube whose sides have vertices of their own, as normals ask for, is closed. One face
// less, or one more, is not.
TEST_F(InfoCommand, KnowsWhatIsWatertight) {
  const Mesh box = Box({0, 0, 0}, {1, 1, 1});
  Mesh torn = box;
  torn.positions.clear();
  torn.faces.clear();
  for (const Face& face : box.faces) {
    const auto first = static_cast<std::int32_t>(torn.positions.size());
    for (const std::int32_t v : face)
      torn.positions.push_back(box.positions[static_cast<std::size_t>(v)]);
    torn.faces.push_back({first, first + 1, first + 2});
  }
  torn.normals.clear();
  torn.corner_normals.clear();
  torn.corner_uvs.clear();
  Mesh open = torn, more = torn;
  open.faces.pop_back();
  more.faces.push_back(more.faces[0]);
  for (const auto& [name, mesh] :
       {std::pair("torn.ply", &torn), {"open.ply", &open}, {"more.ply", &more}}) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex " +
                       std::to_string(mesh->positions.size()) +
                       "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                       std::to_string(mesh->faces.size()) +
                       "\nproperty list uchar int vertex_indices\nend_header\n";
    for (const glm::vec3& p : mesh->positions)
      text += std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + "\n";
    for (const Face& f : mesh->faces)
      text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " +
              std::to_string(f[2]) + "\n";
    Write(name, text);
  }
  const auto all = Described(In("torn.ply") + " " + In("open.ply") + " " + In("more.ply"));
  EXPECT_EQ(all[0]["watertight"], true);
  EXPECT_EQ(all[1]["watertight"], false);
  EXPECT_EQ(all[1]["edges_of_one_face"], 3);
  EXPECT_EQ(all[2]["watertight"], false);
  EXPECT_EQ(all[2]["edges_of_more_than_two"], 3);
  ExpectRefused("info " + In("none.obj") + " " + In("torn.ply"), 3, "watertight: yes");
}

}  // namespace tilegrad::info_test

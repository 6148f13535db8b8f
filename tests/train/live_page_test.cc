// SPDX-License-Identifier: Apache-2.0
// The live page's files: what is going on, the run's curves, pictures and meshes with their
// textures; bounded in number, whole, and safe to load.
#include "train/report/live_page.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/report/html.h"

namespace tilegrad::train::live_page_test {

using nlohmann::json;

// As the page's script gets it.
json ArgumentOf(const Path& file, const std::string& call) {
  const auto text = ReadText(file);
  if (!text.ok() || !text->starts_with(call) || !text->ends_with(");\n")) return nullptr;
  return json::parse(text->substr(call.size(), text->size() - call.size() - 3), nullptr, false);
}

Mesh Textured(int side, std::uint8_t grey) {
  Mesh mesh = Icosphere(1, 0.3f);
  mesh.corner_uvs = SphereUvs(mesh);
  mesh.textures = {{"t", ImageU8(side, side, 3, grey)}};
  mesh.materials = {{.name = "m", .base_color = glm::vec4(1), .base_color_texture = 0}};
  return mesh;
}

class LivePageTest : public TempFolderTest {
 protected:
  LivePageTest() : run_(folder_ / "run") {}

  // As a fit leaves it after so many steps.
  void AddStep(int step) const {
    AddPicture(step);
    const std::string line =
        R"({"step": )" + std::to_string(step) + R"(, "loss": 0.5, "color": 0.25})";
    EXPECT_TRUE(AppendText(run_ / "metrics.jsonl", line + "\n", false).ok());
  }
  void AddPicture(int step) const {
    const Path at = run_ / "timelapse" / fmt::format("{:08}", step);
    EXPECT_TRUE(io::SavePng(at.string() + ".png", ImageU8(4, 4, 3)).ok());
    EXPECT_TRUE(io::SaveGlb(at.string() + ".glb", Textured(8, 90)).ok());
  }
  json State() const { return ArgumentOf(run_ / "live/state.js", "tilegradState("); }
  json MeshAt(int step) const {
    return ArgumentOf(run_ / fmt::format("live/mesh_{:08}.js", step),
                      fmt::format("tilegradMesh({}, ", step))["mesh"];
  }
  std::vector<std::string> Scripts() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(run_ / "live"))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  LivePage Started() const {
    LivePage page({run_, {}, 100, {{"color", "Colour"}}});
    Ok(page.Start());
    return page;
  }

  Path run_;
};

TEST_F(LivePageTest, SaysWhatGoesOnBeforeTheFirstStep) {
  LivePage page = Started();
  EXPECT_EQ(page.file(), run_ / "live.html");
  EXPECT_EQ(State()["running"], true);
  EXPECT_EQ(State()["name"], "run");
  page.Tell({"carving", 3, 7, "a note"});
  EXPECT_EQ(State()["stage"], "carving");
  EXPECT_EQ(State()["done"], 3);
  EXPECT_EQ(State()["total"], 7);
  page.Tell({"carving", 4, 7, ""});  // within a second
  EXPECT_EQ(State()["done"], 3);
  page.Tell({"fitting", 1, 100, ""});  // another stage
  EXPECT_EQ(State()["stage"], "fitting");
}

TEST_F(LivePageTest, HasCurvesPicturesAndTexturedMeshes) {
  LivePage page = Started();
  AddStep(0);
  AddStep(10);
  page.Tell({"fitting", 12, 100, ""});
  const json state = State();
  EXPECT_EQ(state["step"], 10);
  EXPECT_EQ(state["steps"], 100);
  EXPECT_EQ(state["finished"], false);
  EXPECT_EQ(state["curves"]["color"], (json{0.25, 0.25}));
  EXPECT_EQ(state["charts"][1], (json{{"key", "color"}, {"title", "Colour"}}));
  EXPECT_EQ(state["pictures"][1], (json{{"step", 10}, {"file", "timelapse/00000010.png"}}));
  ASSERT_EQ(state["meshes"].size(), 2u);
  const json mesh = MeshAt(10);
  EXPECT_EQ(mesh["face_count"], 80);
  const ImageU8 texels = ImageU8(8, 8, 3, 90);
  EXPECT_EQ(mesh["texture"]["image"], PngAddress(texels).value());
  EXPECT_EQ(mesh["texture"]["wrap"], (json{"REPEAT", "REPEAT"}));
}

// The result has all of its texels, where meshes on the way have fewer.
TEST_F(LivePageTest, EndsWithTheResult) {
  AddStep(0);
  AddStep(60);
  LivePage page = Started();
  const json before = State()["meshes"][1];
  ASSERT_TRUE(io::SaveGlb(run_ / "mesh.glb", Textured(16, 40)).ok());
  ASSERT_TRUE(page.Finish({}).ok());
  EXPECT_EQ(State()["running"], false);
  EXPECT_EQ(State()["finished"], true);  // of 100 steps it needed 60
  EXPECT_EQ(MeshAt(60)["texture"]["image"], PngAddress(ImageU8(16, 16, 3, 40)).value());
  EXPECT_NE(State()["meshes"][1]["made"], before["made"]);
}

TEST_F(LivePageTest, SaysHowItEnded) {
  AddStep(30);
  LivePage page = Started();
  ASSERT_TRUE(page.Finish(Status(StatusCode::kCancelled, "stopped")).ok());
  EXPECT_EQ(State()["finished"], false);
  EXPECT_EQ(State()["error"], "");
  ASSERT_TRUE(page.Finish(Status(StatusCode::kIo, "</script> is full")).ok());
  EXPECT_EQ(State()["error"], "</script> is full");
  ExpectNotIn(*ReadText(run_ / "live/state.js"), "</script>");
}

TEST_F(LivePageTest, KeepsFewFilesAndNoneOfBefore) {
  Write("run/live/mesh_00000777.js", std::string("old"));
  Write("run/live/state.js.99999999.tmp", std::string("half"));
  Write("run/live/mine.js", std::string("of the user"));
  for (int step = 0; step < 70; ++step) AddPicture(step);
  LivePage page = Started();
  const json meshes = State()["meshes"];
  ASSERT_EQ(meshes.size(), 60u);
  EXPECT_EQ(meshes.front()["step"], 0);
  EXPECT_EQ(meshes.back()["step"], 69);
  const std::vector<std::string> scripts = Scripts();
  EXPECT_EQ(scripts.size(), 62u);
  EXPECT_EQ(scripts[60], "mine.js");
  EXPECT_EQ(scripts[61], "state.js");
}

TEST_F(LivePageTest, AMeshThatCannotBeReadIsLeftOutAndTold) {
  AddStep(0);
  Write("run/timelapse/00000005.glb", std::string("no mesh"));
  LivePage page = Started();
  EXPECT_EQ(State()["meshes"].size(), 1u);
  ExpectMessage(page.Finish({}), "00000005.glb");
}

TEST_F(LivePageTest, IsKeptByWhoeverWorksOnTheRun) {
  Started();
  EXPECT_FALSE(LivePage::IsKept(run_));
  const auto lock = FolderLock::Take(run_);
  EXPECT_TRUE(LivePage::IsKept(run_));
  const Path script = run_ / "live/state.js";
  std::filesystem::last_write_time(
      script, std::filesystem::last_write_time(script) - std::chrono::minutes(1));
  EXPECT_FALSE(LivePage::IsKept(run_));
}

TEST(LivePageAddress, HasNoCharacterThatAShellObeys) {
  EXPECT_EQ(FileAddress("/a b/'$(x)`\"ä/live.html"),
            "file:///a%20b/%27%24%28x%29%60%22%C3%A4/live.html");
}

}  // namespace tilegrad::train::live_page_test

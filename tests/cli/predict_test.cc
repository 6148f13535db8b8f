// SPDX-License-Identifier: Apache-2.0
// What predict says of its inputs, and the animation that it writes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "fit/refine.h"
#include "io/image_file.h"
#include "support/run_program.h"
#include "support/terminal.h"

namespace tilegrad::predict_test {

class Predict : public ProgramTest {
 protected:
  void SetUp() override {
    ExpectDone("dataset --source procedural --per-class 6 --size 16 --views 4 --out " + In("d"));
    MakeRun(In("d"), In("r"));
    ExpectDone("dataset-view --data " + In("d") + " --split train --out " + In("known.png"));
    ImageU8 stripes(64, 64, 4);  // red and white
    for (int y = 4; y < 60; y += 9) {
      for (int x = 4; x < 60; ++x) {
        std::fill_n(stripes.at(x, y), 4, std::uint8_t{255});
        if (y % 2 == 0) stripes.at(x, y)[1] = stripes.at(x, y)[2] = 0;
      }
    }
    ASSERT_TRUE(io::SavePng(folder_ / "text.png", stripes).ok());
  }
  // What stands behind warnings, and progress where the machine is slow.
  static nlohmann::json JsonOf(const std::string& output) {
    return nlohmann::json::parse(output.substr(output.find("\n[") + 1));
  }
  std::string Said(const std::string& image, const std::string& run = "r") const {
    return ExpectDone("predict --refine 0 --force --run " + In(run) + " --out " + In("out") + " " +
                      In(image));
  }
};

TEST_F(Predict, SaysWhatIsUnlikeTheTrainingPictures) {
  ExpectNotIn(Said("known.png"), "unlike");
  const std::string said = Said("text.png");
  ExpectIn(said, "text.png: unlike the ",
           " training images; expect a poor mesh (nearest: ", ", at 0.", "; usual: 0.");
  ExpectIn(Said("text.png", "r/checkpoints/step_00000002.safetensors"), "unlike");
  ExpectDone("export --half --run " + In("r") + " --out " + In("w.safetensors"));
  ExpectIn(Said("text.png", "w.safetensors"), "unlike");
  // It needs no dataset.
  std::filesystem::rename(folder_ / "d", folder_ / "gone");
  const auto first_line = [](const std::string& text) { return text.substr(0, text.find('\n')); };
  EXPECT_EQ(first_line(Said("text.png")), first_line(said));
}

TEST_F(Predict, TakesThePicturesOfFolders) {
  const auto pictures = folder_ / "pictures";
  std::filesystem::create_directory(pictures);
  ExpectError("predict --run " + In("r") + " " + In("pictures"), "pictures: holds no picture");
  for (const char* name : {"b.png", "a.png"})
    std::filesystem::copy_file(folder_ / "known.png", pictures / name);
  std::ofstream(pictures / "c.heic") << "x";
  std::ofstream(pictures / "notes.txt") << "x";
  ExpectIn(Said("pictures"), "skipped 1 picture not in PNG, JPEG or WebP: c.heic");
  for (const char* name : {"a_predicted.glb", "b_predicted.glb"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / name)) << name;
  // Results beside the pictures are no pictures.
  for (int times = 0; times < 2; ++times) {
    ExpectDone("predict --force --refine 1 --run " + In("r") + " --out " + In("pictures") + " " +
               In("pictures"));
  }
  EXPECT_TRUE(std::filesystem::exists(pictures / "a_match.png"));
  EXPECT_FALSE(std::filesystem::exists(pictures / "a_match_predicted.glb"));
  EXPECT_FALSE(std::filesystem::exists(pictures / "a_turntable_predicted.glb"));
}

// The picture that was cut out, before a wall.
TEST_F(Predict, TakesPlainBackgroundsAway) {
  ImageU8 cutout = io::LoadImage(folder_ / "known.png").value();
  ImageU8 wall(4 * cutout.width, 4 * cutout.height, 3), noise = wall;
  for (int y = 0; y < wall.height; ++y) {
    for (int x = 0; x < wall.width; ++x) {
      const std::uint8_t* from = cutout.at(x / 4, y / 4);
      for (int c = 0; c < 3; ++c) {
        wall.at(x, y)[c] = from[3] >= 128 ? from[c] / 2 : 235;
        noise.at(x, y)[c] = static_cast<std::uint8_t>(x * y * (7 + c) % 251);
      }
    }
  }
  ASSERT_TRUE(io::SavePng(folder_ / "wall.png", wall).ok());
  ASSERT_TRUE(io::SavePng(folder_ / "noise.png", noise).ok());
  const auto result = JsonOf(Said("wall.png --json"));
  EXPECT_EQ(result[0]["mesh"], In("out/wall_predicted.glb"));
  ExpectRefused("predict --run " + In("r") + " --out " + In("out") + " " + In("noise.png"), 2,
                "the object is not cut out, and the background is not plain");
}

TEST_F(Predict, DoesItsWorkWithoutTheTrainingPictures) {
  Write("r/thumbnails.npz", "broken");
  const std::string said = Said("text.png");
  ExpectIn(said, "skipped: " + In("r/thumbnails.npz"));
  std::filesystem::remove(folder_ / "r/thumbnails.npz");
  ExpectNotIn(Said("text.png"), "warning");
}

TEST_F(Predict, TheAnimationIsTheSameAgain) {
  const std::string said = Said("known.png");
  ExpectIn(said, "known_turntable.webp");
  const Bytes first = ReadFile(folder_ / "out/known_turntable.webp").value();
  ASSERT_GT(first.size(), 1000u);
  EXPECT_EQ(std::string(first.begin(), first.begin() + 4), "RIFF");
  ExpectDone("predict --refine 0 --force --threads 3 --run " + In("r") + " --out " + In("out") +
             " " + In("known.png"));
  EXPECT_EQ(ReadFile(folder_ / "out/known_turntable.webp").value(), first);
}

TEST_F(Predict, RecordsHowWellTheMeshMatchesItsPicture) {
  const std::string in = In("known.png"), to = " --run " + In("r") + " --out " + In("out") + " ";
  const std::string output = ExpectDone("predict --refine 40 --json" + to + in);
  const auto said = JsonOf(output);
  const Bytes text = ReadFile(folder_ / "out/known_match.json").value();
  const auto record = nlohmann::json::parse(text.begin(), text.end());
  EXPECT_LT(record["silhouette_iou"][0], record["silhouette_iou"][1]);
  EXPECT_GT(record["silhouette_iou"][0], 0);
  EXPECT_LE(record["silhouette_iou"][1], 1);
  EXPECT_GT(record["color_l1"][0], record["color_l1"][1]);
  for (const char* score : {"silhouette_iou", "color_l1"})
    EXPECT_EQ(said[0][score], record[score]) << score;
  EXPECT_EQ(output.find("the camera is ambiguous") != std::string::npos,
            said[0]["camera_doubtful"].get<bool>());
  EXPECT_EQ(record["camera"]["size"], train::kRefineSize);
  // A rotation: its rows have length 1.
  const auto rows = record["camera"]["rotation"].get<std::vector<double>>();
  for (int i = 0; i < 9; i += 3)
    EXPECT_NEAR(std::hypot(rows[i], rows[i + 1], rows[i + 2]), 1, 1e-4) << i;
  EXPECT_GT(record["camera"]["fx"], 0);
}

TEST_F(Predict, TellsItsStagesAndEndsAtCtrlC) {
  const std::string to =
      " --force --run " + In("r") + " --out " + In("out") + " " + In("known.png");
  TerminalProgram whole("predict --refine 20" + to, 200);
  EXPECT_EQ(whole.Finish(), 0) << whole.said();
  for (const char* stage : {"loading the network", "predicting from ", "looking for the camera",
                            "refining", "drawing ", "coding the animation"})
    ExpectIn(whole.said(), stage);
  TerminalProgram cut("predict --refine 100000" + to, 200);
  ASSERT_TRUE(cut.AwaitText("refining")) << cut.said();
  EXPECT_LT(cut.Interrupt(), 2);  // one, on a machine that does other work, too
  EXPECT_EQ(cut.Finish(), 130);
}

// Of a run that predicts light: in the GLB, and moving.
TEST_F(Predict, WritesTheLightAndMovesIt) {
  ExpectDone("train --config " TILEGRAD_CONFIGS "/texture_quick.toml --data " + In("d") +
             " --out " + In("lit") +
             " --set schedule.steps=1 --set schedule.batch=2 --set schedule.portions=2 --set "
             "network.base=2 --set "
             "network.most=4 --set network.levels=2 --set network.latent=8 --set "
             "network.hidden=8 --set network.light_width=8 --set network.lookup_width=4 --set "
             "network.template_level=1");
  const std::string said = ExpectDone("predict --refine 0 --relight --run " + In("lit") +
                                      " --out " + In("out") + " " + In("known.png"));
  const Bytes glb = ReadFile(folder_ / "out/known_predicted.glb").value();
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  const auto json = nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + length);
  EXPECT_EQ(json["extensions"]["KHR_lights_punctual"]["lights"][0]["type"], "directional");
  EXPECT_EQ(json["extensionsUsed"], nlohmann::json::array({"KHR_lights_punctual"}));
  const auto& sun = json["nodes"][1];
  EXPECT_EQ(sun["extensions"]["KHR_lights_punctual"]["light"], 0);
  double square = 0;
  for (const auto& x : sun["rotation"]) square += x.get<double>() * x.get<double>();
  EXPECT_NEAR(square, 1, 1e-6);
  EXPECT_EQ(json["scenes"][0]["nodes"].size(), 2u);
  const Bytes relit = ReadFile(folder_ / "out/known_relit.webp").value();
  EXPECT_EQ(std::string(relit.begin(), relit.begin() + 4), "RIFF");
  // Refined colours would hold the picture's light.
  const std::string rest = " --force --out " + In("out") + " " + In("known.png");
  ExpectError("predict --refine 5 --run " + In("lit") + rest, "use --refine 0");
  // A run without light says so, before it draws anything.
  ExpectError("predict --refine 0 --relight --run " + In("r") + rest,
              "predicts no light; train one with --config texture_quick");
}

}  // namespace tilegrad::predict_test

// SPDX-License-Identifier: Apache-2.0
// tilegrad sample from noise to files: the same bits again, scores, and what it refuses.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/mesh_file.h"
#include "support/run_program.h"
#include "support/temp_folder.h"

namespace tilegrad {
namespace {

constexpr const char* kTextured = R"(name = "textures"
[task]
kind = "textured_image"
[network]
base = 2
most = 4
levels = 2
latent = 8
hidden = 8
light_width = 4
template_level = 1
[schedule]
steps = 1
batch = 2
)";
constexpr const char* kGan = R"(name = "gan"
[task]
kind = "gan"
[network]
noise = 4
shape_noise = 2
hidden = 8
template_level = 1
texture_size = 16
texture_base = 2
texture_most = 4
output_deviation = 0.1
[critic]
base = 2
halvings = 2
[stages]
shape = 1
[textures]
count = 8
[score]
count = 8
[schedule]
steps = 2
batch = 2
)";

class Sample : public TempFolderTest {
 protected:
  void SetUp() override {
    Write("textured.toml", kTextured), Write("gan.toml", kGan);
    ExpectDone("dataset --source procedural --per-class 6 --size 16 --views 4 --out " + In("d"));
    ExpectDone("train --config " + In("textured.toml") + " --data " + In("d") + " --out " +
               In("t"));
    ExpectDone("train --config " + In("gan.toml") + " --data " + In("d") + " --out " + In("g") +
               " --set textures.run=" + In("t"));
  }
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  std::string ExpectDone(const std::string& arguments) const {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.output;
    return outcome.output;
  }
  void ExpectRefused(const std::string& arguments, const std::string& part) const {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_NE(outcome.exit_code, 0) << arguments;
    EXPECT_NE(outcome.output.find(part), std::string::npos) << outcome.output;
  }
};

TEST_F(Sample, TheSameSeedMakesTheSameFiles) {
  const std::string common = "sample --run " + In("g") + " --count 3 --interpolate 2 ";
  ExpectDone(common + "--seed 7 --threads 1 --out " + In("a"));
  ExpectDone(common + "--seed 7 --threads 3 --out " + In("b"));
  ExpectDone(common + "--seed 8 --out " + In("c"));
  for (const char* file : {"sample_001.glb", "sample_003.glb", "sheet.png", "turntable.webp",
                           "interpolation.png", "interpolation.webp"}) {
    const auto a = ReadFile(folder_ / "a" / file), b = ReadFile(folder_ / "b" / file),
               c = ReadFile(folder_ / "c" / file);
    ASSERT_TRUE(a.ok() && b.ok() && c.ok()) << file;
    EXPECT_TRUE(*a == *b) << file;
    EXPECT_FALSE(*a == *c) << file;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a" / "sample_004.glb"));
  const auto loaded = io::LoadMesh(folder_ / "a" / "sample_002.glb");
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ASSERT_EQ(loaded->mesh.textures.size(), 1u);
  EXPECT_EQ(loaded->mesh.textures[0].image.width, 16);
}

TEST_F(Sample, ScoresAgainstTrueObjects) {
  const std::string said =
      ExpectDone("sample --run " + In("g") + " --data " + In("d") +
                 " --count 2 --score --score-count 16 --json --out " + In("s"));
  const auto json = nlohmann::json::parse(said.substr(said.find('{')));
  const auto& scores = json.at("scores");
  EXPECT_EQ(scores.at("n"), 16);
  ASSERT_EQ(scores.at("trained").size(), 3u);
  ASSERT_EQ(scores.at("held_out").size(), 3u);
  EXPECT_EQ(scores.at("trained")[0].at("method"), "true objects (floor)");
  EXPECT_GT(scores.at("trained")[1].at("shapes").at("frechet"),
            scores.at("trained")[0].at("shapes").at("frechet"));
  EXPECT_GT(scores.at("memorisation").at("sample_median"), 0);
  for (const char* file : {"scores.md", "scores.json", "nearest.png"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "s" / file)) << file;
}

TEST_F(Sample, RefusesWhatItCannotDo) {
  ExpectRefused("sample --run " + In("t") + " --out " + In("x"), "makes nothing from noise");
  ExpectRefused("sample --run " + In("g") + " --count 1 --interpolate 4 --out " + In("x"),
                "--count 2 or more");
  ExpectRefused("sample --run " + In("g") + " --judge " + In("t") + " --out " + In("x"),
                "of --score");
  ExpectRefused("sample --run " + In("g") + " --score --judge " + In("t") + " --out " + In("x"),
                "task.kind = \"classify\"");
  Write("y/sheet.png", std::string("mine"));
  ExpectRefused("sample --run " + In("g") + " --out " + In("y"), "sheet.png");
  ExpectRefused("eval --run " + In("g") + " --data " + In("d"), "tilegrad sample --score");
}

}  // namespace
}  // namespace tilegrad

// SPDX-License-Identifier: Apache-2.0
// tilegrad sample from noise to files: the same bits again, scores, and what it refuses.
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "io/mesh_file.h"
#include "support/run_program.h"

namespace tilegrad::sample_test {

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

// One run for all tests.
class Sample : public ProgramTest {
 protected:
  static void SetUpTestSuite() {
    runs_ = Path(testing::TempDir()) / ("tilegrad_sample_runs_" + std::to_string(::getpid()));
    std::filesystem::create_directories(runs_);
    ASSERT_TRUE(WriteTextAtomic(runs_ / "textured.toml", kTextured).ok());
    ASSERT_TRUE(WriteTextAtomic(runs_ / "gan.toml", kTwoStepGan).ok());
    const std::string data = " --data " + Run("d");
    ExpectDone("dataset --source procedural --per-class 4 --size 16 --views 2 --out " + Run("d"));
    ExpectDone("train --config " + Run("textured.toml") + data + " --out " + Run("t"));
    ExpectDone("train --config " + Run("gan.toml") + data + " --out " + Run("g") +
               " --set stages.shape=1 --set textures.run=" + Run("t"));
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(runs_); }

  static std::string Run(const std::string& name) { return (runs_ / name).string(); }

 private:
  static inline Path runs_;
};

TEST_F(Sample, TheSameSeedMakesTheSameFiles) {
  const std::string common = "sample --run " + Run("g") + " --count 2 ";
  ExpectDone(common + "--interpolate 1 --seed 7 --threads 1 --out " + In("a"));
  ExpectDone(common + "--interpolate 1 --seed 7 --threads 3 --out " + In("b"));
  ExpectDone(common + "--seed 8 --out " + In("c"));
  for (const char* file : {"sample_001.glb", "sample_002.glb", "sheet.png", "turntable.webp",
                           "interpolation.png", "interpolation.webp"}) {
    const auto a = ReadFile(folder_ / "a" / file), b = ReadFile(folder_ / "b" / file);
    ASSERT_TRUE(a.ok() && b.ok()) << file;
    EXPECT_TRUE(*a == *b) << file;
  }
  EXPECT_FALSE(ReadFile(folder_ / "a/sample_001.glb").value() ==
               ReadFile(folder_ / "c/sample_001.glb").value());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a" / "sample_003.glb"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c" / "interpolation.png"));
  const auto loaded = Ok(io::LoadMesh(folder_ / "a" / "sample_002.glb"));
  ASSERT_EQ(loaded->mesh.textures.size(), 1u);
  EXPECT_EQ(loaded->mesh.textures[0].image.width, 16);
}

TEST_F(Sample, ScoresAgainstTrueObjects) {
  const std::string said =
      ExpectDone("sample --run " + Run("g") + " --data " + Run("d") +
                 " --count 1 --score --score-count 16 --json --out " + In("s"));
  ASSERT_NE(said.find('{'), std::string::npos) << said;
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

TEST_F(Sample, ForceLeavesNoneOfEarlierCalls) {
  const std::string common = "sample --run " + Run("g") + " --out " + In("a");
  ExpectDone(common + " --count 3 --interpolate 1");
  Write("a/mine.txt", "mine");
  ExpectDone(common + " --count 2 --force");
  EXPECT_TRUE(Exists("a/sample_002.glb") && Exists("a/sheet.png") && Exists("a/mine.txt"));
  EXPECT_FALSE(Exists("a/sample_003.glb") || Exists("a/interpolation.png"));
}

TEST_F(Sample, WritesNothingIfItsScoresAreRefused) {
  const std::string common = "sample --score --count 1 --run " + Run("g") + " --out " + In("x");
  ExpectError(common + " --data " + In("none"), "none: ");
  ExpectError(common + " --data " + Run("d") + " --judge " + Run("t"), "\"classify\"");
  EXPECT_FALSE(Exists("x"));
}

// Paths of a run that moved, or that is resumed from another folder.
TEST_F(Sample, RunsFindTheirTextures) {
  const auto from = [](const std::string& folder) { return "cd " + folder + " && "; };
  ExpectDone("train --config gan.toml --data d --out h --set stages.shape=1 --set textures.run=t",
             from(Run("")));
  std::filesystem::copy(Run("h"), folder_ / "h", std::filesystem::copy_options::recursive);
  const std::string elsewhere = from(folder_.string());
  ExpectDone("train --resume " + Run("h") + " --steps 3", elsewhere);
  const std::string moved = "train --resume h --steps 3 --data " + Run("d");
  ExpectRefused(RunProgram(moved, elsewhere), 3, "textures.run = \"t\"");
  ExpectDone(moved + " --set textures.run=" + Run("t"), elsewhere);
  ExpectRefused(RunProgram(moved + " --set textures.count=3", elsewhere), 2,
                "another configuration");
}

TEST_F(Sample, RefusesWhatItCannotDo) {
  ExpectError("sample --run " + Run("t") + " --out " + In("x"),
              "not a generator; train one with --config gan_quick");
  ExpectError("sample --run " + Run("g") + " --count 1 --interpolate 4 --out " + In("x"),
              "--interpolate needs two samples or more");
  ExpectError("sample --run " + Run("g") + " --judge " + Run("t") + " --out " + In("x"),
              "need --score");
  ExpectError("sample --run " + Run("g") + " --score --judge " + Run("t") + " --out " + In("x"),
              "task.kind = \"classify\"");
  ExpectError("sample --run " + Run("g") + " --seed -1 --out " + In("x"), "--seed: -1");
  Write("y/sheet.png", "mine");
  ExpectError("sample --run " + Run("g") + " --out " + In("y"), "sheet.png");
  ExpectError("eval --run " + Run("g") + " --data " + Run("d"), "tilegrad sample --score");
}

}  // namespace tilegrad::sample_test

// SPDX-License-Identifier: Apache-2.0
// Runs that go on from their folder alone, are extended, and are animated.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::runs_test {

using Json = nlohmann::json;

class Runs : public ProgramTest {
 protected:
  // Under --json, what it says.
  Json Done(const std::string& arguments) const {
    const std::string outcome = ExpectDone(arguments + " --json");
    const auto begin = outcome.find('{');
    return begin == std::string::npos ? Json() : Json::parse(outcome.substr(begin));
  }
  Bytes Checkpoint(const std::string& run, const std::string& step) const {
    return ReadFile(folder_ / run / "checkpoints" / ("step_" + step + ".safetensors")).value();
  }
  std::string Start(const std::string& run) const {
    return "train --config " + In("tiny.toml") + " --data " + In("data") + " --out " + In(run);
  }
  void SetUp() override {
    Write("tiny.toml",
          "name = \"tiny\"\n[network]\nchannels = 4\ncode = 8\n"
          "hidden1 = 8\nhidden2 = 8\ntemplate_level = 1\n[schedule]\n"
          "batch = 2\nsteps = 3\ncheckpoint_every = 1\n");
  }
  void MakeData() const {
    Done("dataset --source procedural --per-class 3 --size 32 --views 2 --out " + In("data"));
  }
};

TEST_F(Runs, GoOnFromTheirFolderAlone) {
  MakeData();
  Done(Start("whole"));
  Done(Start("run") + " --set schedule.steps=3");
  std::filesystem::remove(folder_ / "run/checkpoints/step_00000003.safetensors");
  const Json rest = Done("train --resume " + In("run"));
  EXPECT_EQ(rest["first_step"], 2);
  EXPECT_EQ(rest["last_step"], 3);
  EXPECT_EQ(rest["finished"], true);
  // Seconds differ; the rest of the file follows its header.
  const Bytes a = Checkpoint("run", "00000003"), b = Checkpoint("whole", "00000003");
  EXPECT_TRUE(std::equal(a.end() - 1000, a.end(), b.end() - 1000));
  const Outcome said = RunProgram("train --resume " + In("run") + " --steps 4");
  ExpectIn(said.output, "tensorboard --logdir " + In("run"));
  // Commands to type are what a shell reads.
  ExpectIn(ExpectDone(Start("run") + "\\ 2"), "eval --run '" + In("run 2") + "'");
}

TEST_F(Runs, AreProfiledBeforeTheyExist) {
  MakeData();
  const std::string profile = "profile --config " + In("tiny.toml") + " --data " + In("data");
  const Json said = Done(profile + " --steps 2 --workers 2,16 --set schedule.batch=4");
  ASSERT_EQ(said["forecasts"].size(), 2u);
  EXPECT_EQ(said["forecasts"][1]["workers"], 16);
  for (const Json& forecast : said["forecasts"]) {
    double work = 0, seconds = 0;
    for (const Json& place : forecast["places"]) {
      work += place["work"].get<double>();
      seconds += place["seconds"].get<double>();
    }
    EXPECT_NEAR(forecast["seconds"].get<double>(), seconds, 1e-6);
    EXPECT_GE(seconds * forecast["workers"].get<int>(), work * (1 - 1e-6));
  }
  ExpectIn(ExpectDone(profile + " --steps 1 --workers 2"), "times as fast");
  ExpectRefused(profile + " --workers 1", 2, "--workers");
  ExpectRefused(profile + " --set schedule.batches=4", 2, "schedule.batch");
}

TEST_F(Runs, SayWhereTheirFirstSampleSheetIs) {
  MakeData();
  const Outcome said = RunProgram(Start("run") + " --set schedule.steps=12");
  const std::string line = "sample sheet: " + In("run/samples/step_00000010.png") +
                           " (a new one at least every 1000 steps)\n";
  const auto at = said.output.find(line);
  ASSERT_NE(at, std::string::npos) << said.output;
  EXPECT_EQ(said.output.find("sample sheet", at + 1), std::string::npos) << said.output;
  EXPECT_TRUE(Exists("run/samples/step_00000010.png"));
  const Outcome quiet = RunProgram(Start("quiet") + " --quiet");
  ExpectNotIn(quiet.output, "sample sheet");
}

TEST_F(Runs, AreExtendedIfAskedTo) {
  MakeData();
  Done(Start("run"));
  // The same command with other settings stays an error.
  ExpectRefused(Start("run") + " --resume --set schedule.steps=5", 2, "schedule.steps");
  const Json more = Done("train --resume " + In("run") + " --steps 5");
  EXPECT_EQ(more["first_step"], 3);
  EXPECT_EQ(more["last_step"], 5);
  // It is a run of five steps now, also where its newest checkpoint is of before.
  for (const char* step : {"00000004", "00000005"})
    std::filesystem::remove(folder_ /
                            ("run/checkpoints/step_" + std::string(step) + ".safetensors"));
  EXPECT_EQ(Done("train --resume " + In("run"))["last_step"], 5);
  ExpectRefused("train --resume " + In("run") + " --steps 2", 2, "has 5 steps already");
  ExpectRefused("train --resume " + In("run") + " --set network.code=9 --steps 9", 2,
                "network.code");
}

TEST_F(Runs, SayWhatIsMissing) {
  ExpectRefused("train --resume " + In("none"), 3, "none: not a run of tilegrad train");
  ExpectRefused("train", 2, "tilegrad: train: --config is required; see tilegrad train --help");
  ExpectRefused("train --config quick --data x", 2, "train: --out is required");
  ExpectRefused("train --resume", 2, "--config is required");
  ExpectRefused("train --config quick --data none --out " + In("c") + " --live=9000", 2,
                "train: --live takes no value");
  Write("run/config.toml", "name = \"a\"\n");
  ExpectRefused("train --resume " + In("run"), 3, "no run.json",
                "tilegrad train --resume " + In("run") + " --data DATASET");
  ExpectRefused("train --resume " + In("run") + " --out " + In("b"), 2, "leave out --out");
}

TEST_F(Runs, OfFitsGoOnWithoutAnyOption) {
  ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
  Done("views " + In("a.glb") + " --views 5 --held-out 0 --size 32 --out " + In("views"));
  const std::string in_folder = "cd " + folder_.string() + " && ";
  ExpectDone(
      "fit views --steps 4 --smoothing 3 --light-direction 1 0 0 --lighting lambert --rate "
      "positions=0.01,texture=0.02 --start sphere --hold-out 3 --out fit",
      in_folder);
  const std::string go_on = "fit --resume --out " + In("fit");
  const Json more = Done(go_on + " --steps 6");  // and from another folder
  EXPECT_EQ(more["steps"], 6);
  EXPECT_EQ(more["training"]["views"], 4);
  EXPECT_EQ(Done(go_on)["steps"], 6);  // it is a fit of six steps now
  ExpectRefused(go_on + " --steps 3", 2, "has 6 steps already, more than 3");
  EXPECT_EQ(Done(go_on)["steps"], 6);
  // What was given or not given then, by name and with both values.
  ExpectRefused(go_on + " --smoothing 4", 2, "--smoothing: was 3, is 4; leave it out");
  ExpectRefused(go_on + " --laplacian 2", 2, "--laplacian: was 0, is 2");
  ExpectRefused(go_on + " --background none", 2, "--background: was auto, is none");
  ExpectRefused(go_on + " --find-cameras", 2, "--find-cameras: was ");
  ExpectRefused("fit " + In("a.glb") + " --resume --out " + In("fit"), 2, "input: was ");
  Done(go_on + " --smoothing 3.0 --timelapse 2 --threads 1");
  Done("fit " + In("views/../views") + " --resume --out " + In("fit"));
  std::filesystem::remove(folder_ / "fit/fit.txt");  // of earlier versions, and of Python's
  ExpectRefused(go_on, 2, "fit: input is required");
}

TEST_F(Runs, OfOneKindAreNotTakenForAnother) {
  MakeData();
  Done(Start("train"));
  ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
  Done("views " + In("a.glb") + " --views 3 --size 32 --out " + In("views"));
  Done("fit " + In("views") + " --steps 1 --out " + In("fit"));
  const std::string fit = In("fit"), picture = " " + In("views/images/000.png");
  ExpectRefused("predict --run " + fit + picture, 2, "fit: is a fit, which predicts nothing");
  ExpectRefused("sample --run " + fit + " --out " + In("s"), 2, "is a fit, which predicts nothing");
  ExpectRefused("predict --run " + In("views") + picture, 3, "views: not the folder of a run");
  ExpectRefused("fit " + In("views") + " --resume --out " + In("train"), 2,
                "train: is a run of tilegrad train, not a fit");
  ExpectRefused("train --resume " + fit, 3, "fit: not a run of tilegrad train");
}

// The log may end some steps before the network that was saved.
TEST_F(Runs, ReportsCountTheStepsOfTheNetwork) {
  MakeData();
  Done(Start("run") + " --set schedule.log_every=2 --steps 3");
  const std::string log = ReadText(folder_ / "run/metrics.jsonl").value();
  Write("run/metrics.jsonl", log.substr(0, log.rfind("{\"step\":3")));
  Done("report --run " + In("run") + " --models 0");
  ExpectIn(*ReadText(folder_ / "run/report.html"), "was trained for 3 steps");
}

TEST_F(Runs, OfFitsAreAnimated) {
  ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
  Done("views " + In("a.glb") + " --views 3 --size 32 --out " + In("views"));
  Done("fit " + In("views") + " --steps 6 --timelapse 3 --out " + In("fit"));
  const Json made = Done("timelapse " + In("fit") + " --size 32 --frames 6");
  EXPECT_EQ(made["meshes"], 4);  // at steps 0, 3 and 6, and the result
  const Bytes file = ReadFile(folder_ / "fit/timelapse.webp").value();
  EXPECT_EQ(std::string(file.begin() + 8, file.begin() + 12), "WEBP");
  Done("fit " + In("views") + " --steps 2 --timelapse 0 --out " + In("bare"));
  ExpectRefused("timelapse " + In("bare"), 3, "no meshes to animate");
}

// A page without a server. Commands that are refused leave none, and leave that of a run alone.
TEST_F(Runs, HaveALivePage) {
  const Path page = folder_ / "run/live.html", script = folder_ / "run/live/state.js";
  ExpectRefused(Start("run") + " --live", 3, "data");
  EXPECT_FALSE(PathExists(page));
  MakeData();
  ExpectIn(ExpectDone(Start("run") + " --live"), "live page: file://" + page.string());
  const std::string state = ReadText(script).value();
  ExpectIn(state, "\"finished\":true");
  EXPECT_TRUE(Exists("run/live/mesh_00000003.js"));  // predicted
  ExpectRefused(Start("run") + " --live", 2, "already holds a run");
  EXPECT_EQ(ReadText(script).value(), state);
  Done(Start("run") + " --force");
  EXPECT_FALSE(PathExists(page) || PathExists(script));
  const Json said = Done("live " + In("run"));
  EXPECT_EQ(said["page"], page.string());
  EXPECT_EQ(said["address"], "file://" + page.string());
  ExpectIn(*ReadText(script), "\"finished\":true");
}

TEST_F(Runs, AreTheOnlyFoldersToLookAt) {
  Write("photos/a.png", "x");
  for (const char* command : {"live ", "timelapse "}) {
    ExpectRefused(command + In("nope"), 3, "nope does not exist");
    ExpectRefused(command + In("photos"), 3, "photos: not the folder of a training or a fit");
  }
  EXPECT_FALSE(Exists("photos/live.html"));
}

}  // namespace tilegrad::runs_test

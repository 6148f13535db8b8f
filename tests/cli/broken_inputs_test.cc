// SPDX-License-Identifier: Apache-2.0
// The program itself on broken inputs: a message that names what is wrong, a non-zero exit code, no
// crash, nothing lost.
#include <gtest/gtest.h>

#include <cstdlib>

#include "base/simd_target.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"
#include "support/source_dir.h"

namespace tilegrad::broken_inputs_test {

// A tiny dataset and a run of two steps, made once for all cases.
class BrokenInputs : public ProgramTest {
 protected:
  static void SetUpTestSuite() {
    shared_ = Path(testing::TempDir()) / ("tilegrad_cli_" + std::to_string(::getpid()));
    std::filesystem::create_directories(shared_);
    ExpectDone("dataset --source procedural --per-class 2 --size 16 --views 3 --out " +
               Data().string());
    ExpectDone("train --config " + Config() + " --data " + Data().string() + " --out " +
               RunFolder().string() + kTiny);
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(shared_); }

  static Path Data() { return shared_ / "data"; }
  static Path RunFolder() { return shared_ / "run"; }
  static std::string Config() { return std::string(TILEGRAD_SOURCE_DIR) + "/configs/quick.toml"; }
  static constexpr const char* kTiny =
      " --set schedule.steps=2 --set schedule.batch=4 --set network.channels=2 --set "
      "network.code=8 --set network.hidden1=8"
      " --set network.hidden2=8 --set network.template_level=1";

  template <class... Parts>
  void ExpectRefused(const std::string& arguments, const Parts&... parts) {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_GT(outcome.exit_code, 0) << arguments << "\n" << outcome.output;
    // Neither a signal nor a failure of the shell itself.
    EXPECT_LT(outcome.exit_code, 126) << outcome.output;
    for (const std::string& part : std::vector<std::string>{parts...}) {
      EXPECT_NE(outcome.output.find(part), std::string::npos)
          << "\"" << part << "\" is not in: " << outcome.output;
    }
  }

  // A folder source with this one model: nothing usable, so the command fails, and rejected.jsonl
  // or the message names the file.
  void ExpectRejectedModel(const std::string& file, const std::string& content) {
    Write("in/thing/" + file, content);
    const Path out = folder_ / "out";
    ExpectRefused("dataset --source folder --input " + (folder_ / "in").string() + " --out " +
                  out.string());
    const auto list = ReadText(out / "rejected.jsonl");
    ASSERT_TRUE(list.ok()) << list.status().message();
    EXPECT_NE(list->find(file), std::string::npos) << *list;
    std::filesystem::remove_all(folder_ / "in");
    std::filesystem::remove_all(out);
  }

  std::string Predict(const Path& image, const std::string& more = "") {
    return "predict --run " + RunFolder().string() + " --out " + folder_.string() + " " +
           image.string() + more;
  }
  std::string Train(const Path& config, const Path& data) {
    return "train --config " + config.string() + " --data " + data.string() + " --out " +
           (folder_ / "new").string() + kTiny;
  }
  Path CopyOfData() {
    std::filesystem::copy(Data(), folder_ / "copy", std::filesystem::copy_options::recursive);
    return folder_ / "copy";
  }

  static inline Path shared_;
};

std::string Text(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }

TEST_F(BrokenInputs, Models) {
  const std::string glb = Text(io::EncodeGlb(Icosphere(1, 1)).value());
  ExpectRejectedModel("truncated.glb", glb.substr(0, glb.size() / 2));
  std::string factor = glb;  // of the base colour: beyond float
  const auto at = factor.find("baseColorFactor\":[1.0");
  ASSERT_NE(at, std::string::npos);
  ExpectRejectedModel("factor.glb", factor.replace(at + 18, 15, "9e99,1,1,1     "));
  ExpectRejectedModel("json.gltf", "{\"asset\": ");
  ExpectRejectedModel("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
  ExpectRejectedModel("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  ExpectRejectedModel("empty.obj", "");
  ExpectRejectedModel("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n");
  ExpectRejectedModel("garbage.ply", std::string(300, '\xfe'));
}

TEST_F(BrokenInputs, Images) {
  ImageU8 image(8, 8, 4, 255);
  ASSERT_TRUE(io::SavePng(folder_ / "opaque.png", image).ok());
  ExpectRefused(Predict(folder_ / "opaque.png"), "opaque.png", "mask");
  ASSERT_TRUE(io::SavePng(folder_ / "rgb.png", ImageU8(8, 8, 3, 9)).ok());
  ExpectRefused(Predict(folder_ / "rgb.png"), "rgb.png", "transparent background");
  ExpectRefused(Predict(folder_ / "rgb.png", " --mask " + (folder_ / "opaque.png").string()),
                "not cut out");
  ASSERT_TRUE(io::SavePng(folder_ / "small.png", ImageU8(4, 4, 1, 255)).ok());
  ExpectRefused(Predict(folder_ / "rgb.png", " --mask " + (folder_ / "small.png").string()),
                "4 x 4", "8 x 8");
  ASSERT_TRUE(io::SavePng(folder_ / "clear.png", ImageU8(8, 8, 4, 0)).ok());
  ExpectRefused(Predict(folder_ / "clear.png"), "clear.png", "no pixel");
  Bytes png = io::EncodePng(image).value();
  Write("cut.png", Bytes(png.begin(), png.begin() + 40));
  ExpectRefused(Predict(folder_ / "cut.png"), "cut.png");
  png[16] = 0x7f;
  Write("lie.png", png);
  ExpectRefused(Predict(folder_ / "lie.png"), "lie.png");
  ExpectRefused(Predict(folder_ / "none.png"), "none.png");
}

TEST_F(BrokenInputs, ConfigurationsAndCommandLines) {
  ExpectRefused(Train(Write("key.toml", "[network]\nchanels = 3\n"), Data()), "key.toml", "line 2",
                "network.channels");
  ExpectRefused(Train(Write("range.toml", "[schedule]\nbatch = -1\n"), Data()), "line 2",
                "schedule.batch");
  ExpectRefused(Train(folder_ / "none.toml", Data()), "none.toml");
  ExpectRefused(Train(Config(), folder_ / "nowhere"), "nowhere: no such folder");
  ExpectRefused("train --config " + Config() + " --data " + Data().string() + " --out " +
                    RunFolder().string(),
                "--resume");
  ExpectRefused("dance", "dance");
  ExpectRefused("predict --run " + folder_.string() + " x.png", folder_.string());
  ::setenv("TILEGRAD_TARGET", "AVX9", 1);
  ExpectRefused("info", "AVX9", RunnableTargets().back());
  ::unsetenv("TILEGRAD_TARGET");
}

TEST_F(BrokenInputs, DatasetsAndCheckpoints) {
  const Path copy = CopyOfData();
  Write("copy/dataset.json", "{\"format\": 1,");
  ExpectRefused(Train(Config(), copy), "dataset.json");
  std::filesystem::remove_all(copy);
  CopyOfData();
  Write("copy/models.jsonl", "nonsense\n");
  ExpectRefused(Train(Config(), copy), "models.jsonl", "line 1");
  std::filesystem::remove_all(copy);
  CopyOfData();
  for (const auto& entry : std::filesystem::recursive_directory_iterator(copy / "models")) {
    if (entry.path().extension() == ".npz") std::filesystem::resize_file(entry.path(), 100);
  }
  ExpectRefused(Train(Config(), copy), ".npz");
  std::filesystem::create_directories(folder_ / "half/checkpoints");
  for (const auto& entry : std::filesystem::directory_iterator(RunFolder() / "checkpoints")) {
    const Bytes whole = ReadFile(entry.path()).value();
    Write("half/checkpoints/" + entry.path().filename().string(),
          Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2)));
  }
  ExpectRefused("predict --run " + (folder_ / "half").string() + " x.png", "half", "step_");
}

TEST_F(BrokenInputs, SeveralImagesOneOfThemBad) {
  ImageU8 image(8, 8, 4, 255);
  image.at(0, 0)[3] = 0;
  for (const char* name : {"a/x.png", "b/x.png"}) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(io::SavePng(folder_ / name, image).ok());
  }
  ASSERT_TRUE(io::SavePng(folder_ / "opaque.png", ImageU8(8, 8, 4, 255)).ok());
  const Outcome outcome =
      RunProgram("predict --run " + RunFolder().string() + " --out " + folder_.string() + " " +
                 (folder_ / "none.png").string() + " " + (folder_ / "a/x.png").string() + " " +
                 (folder_ / "b/x.png").string() + " " + (folder_ / "opaque.png").string());
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;  // the first one's: missing
  // Two images of one name are two meshes.
  for (const char* name :
       {"x_predicted.glb", "x_turntable.png", "x_2_predicted.glb", "x_2_turntable.png"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / name)) << name;
}

TEST_F(BrokenInputs, DatasetsOfOtherFoldersOrSplits) {
  const Path copy = CopyOfData(), run = folder_ / "run";
  std::filesystem::copy(RunFolder(), run, std::filesystem::copy_options::recursive);
  std::string models = ReadText(copy / "models.jsonl").value();
  for (std::size_t at; (at = models.find("\"train\"")) != std::string::npos;)
    models.replace(at, 7, "\"test\"");
  Write("copy/models.jsonl", models);
  for (const std::string command : {"eval", "report"}) {
    ExpectRefused(command + " --run " + run.string() + " --data " + copy.string(), "trained on",
                  "split anew");
  }
  for (std::size_t at; (at = models.find("\"test\"")) != std::string::npos;)
    models.replace(at, 6, "\"validation\"");
  Write("copy/models.jsonl", models);
  ExpectRefused("eval --run " + run.string() + " --data " + copy.string(),
                copy.string() + ": its test split has no models");
  EXPECT_EQ(RunProgram("dataset-view --split validation --data " + copy.string() + " --out " +
                       (folder_ / "view.png").string())
                .exit_code,
            0);
  const std::string json = ReadText(run / "run.json").value();
  const auto at = json.find(Data().string());
  ASSERT_NE(at, std::string::npos);
  Write("run/run.json", std::string(json).replace(at, Data().string().size(), "elsewhere"));
  ExpectRefused("eval --run " + run.string(), "elsewhere", "--data");
  // A relative name is also looked for in the folders above the run.
  Write("run/run.json", std::string(json).replace(at, Data().string().size(), "copy"));
  ExpectRefused("eval --run " + run.string(), copy.string() + ": its test split has no models");
}

TEST_F(BrokenInputs, DatasetsOfAnotherImageSize) {
  const std::string data = (folder_ / "large").string();
  ASSERT_EQ(RunProgram("dataset --source procedural --per-class 2 --size 32 --views 3 --seed 9 " +
                       ("--out " + data))
                .exit_code,
            0);
  for (const std::string command : {"eval", "report"}) {
    ExpectRefused(command + " --run " + RunFolder().string() + " --data " + data,
                  data + ": images are 32 pixels a side, the network was trained on 16");
  }
}

TEST_F(BrokenInputs, OutputThatCannotBePrinted) {
  EXPECT_EQ(RunProgram("info > /dev/full").exit_code, 1);
  EXPECT_EQ(RunProgram("render none.obj 2> /dev/full; exit $?").exit_code, 3);
  // Nor does training end for want of its progress line, which comes after two seconds; and that
  // does not go into files where the stream is closed.
  const auto train = [](const Path& out, const std::string& streams) {
    return RunProgram("train --config " + Config() + " --data " + Data().string() + " --out " +
                      out.string() + kTiny + " --set schedule.steps=100000 --max-minutes 0.05 " +
                      streams);
  };
  for (const std::string streams : {"2> /dev/full; exit $?", "<&- 2>&-; exit $?"}) {
    const Path out = folder_ / std::to_string(streams.size());
    const Outcome outcome = train(out, streams);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_EQ(ReadText(out / "metrics.jsonl").value().find("training"), std::string::npos);
    EXPECT_FALSE(std::filesystem::is_empty(out / "checkpoints"));
  }
}

TEST_F(BrokenInputs, OptionsThatMeanSomethingElse) {
  ExpectRefused(
      "dataset-view --data " + Data().string() + " --out " + (folder_ / "view.jpg").string(),
      "view.jpg", ".png");
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  ExpectRefused("dataset --source procedural --seed -1 --out " + (folder_ / "d").string(),
                "--seed");
  ExpectRefused("fit " + Data().string() + " --seed -1", "--seed");
  ExpectRefused("fit " + Data().string() + " --out " + (folder_ / "fit").string(), "--model");
  ExpectRefused(
      "fit " + (Data() / "dataset.json").string() + " --out " + (folder_ / "fit").string(),
      "is a file; give the folder");
}

TEST_F(BrokenInputs, OptionsThatWouldDoNothing) {
  const std::string fit = "fit " + folder_.string() + " --out " + (folder_ / "fit").string();
  ExpectRefused(fit + " --light-direction 0 0 1", "--light-direction", "--lighting");
  ExpectRefused(fit + " --rate camera=0.1", "camera is not fitted", "--optimize");
  ExpectRefused(fit + " --rate uv=0.1 --optimize texture", "uv is not fitted");
  ExpectRefused(fit + " --rate texture=1e6 --optimize texture", "[0, 1000000)");
  ExpectRefused(fit + " --rate texture=0.1 --optimize texture", "transforms.json");  // no images
  const std::string dataset = "dataset --out " + (folder_ / "d").string();
  ExpectRefused(dataset + " --source procedural --split-list a", "--split-list", "shapenet");
  ExpectRefused(dataset + " --source procedural --input a", "--input", "procedural");
  ExpectRefused(dataset + " --source nmr --input a --test-share 0.1", "--test-share", "its own");
  ExpectRefused(dataset + " --source shapenet --input a --split-list b --validation-share 0.1",
                "--validation-share", "--split-list");
  ExpectRefused("dataset-view --data " + Data().string() + " --model a --class b", "--class",
                "--model");
}

// What the program writes into a run's folder when it looks at it does not make the run newer.
TEST_F(BrokenInputs, TheNewestRunIsTheOneThatWasTrainedLast) {
  using std::filesystem::last_write_time;
  const auto options = std::filesystem::copy_options::recursive;
  std::filesystem::create_directories(folder_ / "runs/started");
  for (const char* name : {"old", "new"})
    std::filesystem::copy(RunFolder(), folder_ / "runs" / name, options);
  Write("runs/started/run.json", "{}");
  const auto now = last_write_time(folder_ / "runs/new/run.json");
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "runs/old/checkpoints"))
    last_write_time(entry.path(), now - std::chrono::hours(1));
  last_write_time(folder_ / "runs/old", now + std::chrono::hours(1));
  const Path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  const Outcome outcome = RunProgram("report");
  std::filesystem::remove_all(folder_ / "runs/new");
  std::filesystem::remove_all(folder_ / "runs/old");
  const Outcome none = RunProgram("report");
  std::filesystem::current_path(before);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("runs/new: taking the newest run"), std::string::npos)
      << outcome.output;
  EXPECT_EQ(none.exit_code, 3) << none.output;
}

// 3: what is to be read is missing; 1: what is to be written cannot be.
TEST_F(BrokenInputs, ExitCodesOfPlaces) {
  Write("file", "in the way");
  const auto code = [](const std::string& arguments, const std::string& part) {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_NE(outcome.output.find(part), std::string::npos) << outcome.output;
    return outcome.exit_code;
  };
  const std::string file = (folder_ / "file").string();
  EXPECT_EQ(code("eval --run " + file, file + ": not a run folder"), 3);
  EXPECT_EQ(code("eval --run " + folder_.string(), "no run.json"), 3);
  EXPECT_EQ(code(Train(file + "/a.toml", Data()), "a.toml"), 3);
  EXPECT_EQ(code("report --run " + RunFolder().string() + " --out /proc/a.html", "/proc/a.html: "),
            1);
  EXPECT_EQ(
      code("train --config " + Config() + " --data " + Data().string() + " --out ''", "is empty"),
      2);
}

// A variable that was not set is neither the current folder nor the newest run.
TEST_F(BrokenInputs, EmptyValues) {
  const Path before = std::filesystem::current_path();
  std::filesystem::current_path(Data());
  const auto expect = [](const std::string& arguments, const std::string& message) {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_EQ(outcome.output, "tilegrad: " + message + ": the value is empty\n");
  };
  expect("train --config " + Config() + " --data '' --out " + (folder_ / "new").string() + kTiny,
         "--data");
  expect("eval --run " + RunFolder().string() + " --data ''", "--data");
  expect("eval --run ''", "--run");
  expect("views '' --out " + folder_.string(), "mesh");
  std::filesystem::current_path(before);
}

// The files of an evaluation are there even if its table goes nowhere: nothing is kept in memory
// here until the end, so that the first words fail.
TEST_F(BrokenInputs, AnEvaluationThatCannotBePrintedIsWritten) {
  std::filesystem::copy(RunFolder(), folder_ / "run", std::filesystem::copy_options::recursive);
  const auto options = " --run " + (folder_ / "run").string() + " --views-per-model 1";
  const Outcome outcome = RunProgram("--version > /dev/null; stdbuf -o0 " TILEGRAD_PROGRAM " eval" +
                                     options + " 2>&1 > /dev/full; exit $?");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
  EXPECT_NE(outcome.output.find("tilegrad: standard output: No space left"), std::string::npos)
      << outcome.output;
  for (const char* name : {"eval.json", "eval.md"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "run" / name)) << name;
  }
  EXPECT_EQ(RunProgram("report" + (" --run " + (folder_ / "run").string())).exit_code, 0);
}

TEST_F(BrokenInputs, PlacesThatCannotBeWritten) {
  Write("file", "in the way");
  ExpectRefused("dataset --source procedural --per-class 1 --size 16 --views 1 --out " +
                    (folder_ / "file/x").string(),
                "file");
  ExpectRefused("train --config " + Config() + " --data " + Data().string() + " --out " +
                    (folder_ / "file/x").string() + kTiny,
                "file");
  EXPECT_EQ(ReadText(folder_ / "file").value(), "in the way");
}

}  // namespace tilegrad::broken_inputs_test

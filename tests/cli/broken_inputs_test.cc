// SPDX-License-Identifier: Apache-2.0
// The program itself on broken inputs: a message that names what is wrong, a non-zero exit code, no
// crash, nothing lost.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/simd_target.h"
#include "base/text.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::broken_inputs_test {

// A tiny dataset and a run of two steps, made once for all cases.
class BrokenInputs : public ProgramTest {
 protected:
  static void SetUpTestSuite() {
    shared_ = Path(testing::TempDir()) / ("tilegrad_cli_" + std::to_string(::getpid()));
    std::filesystem::create_directories(shared_);
    MakeData(Data());
    MakeRun(Data(), Run());
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(shared_); }

  static std::string Data() { return (shared_ / "data").string(); }
  static std::string Run() { return (shared_ / "run").string(); }

  // A folder source with this one model: nothing usable, so the command fails, and rejected.jsonl
  // or the message names the file.
  void ExpectRejectedModel(const std::string& file, const std::string& content) {
    Write("in/thing/" + file, content);
    ExpectError("dataset --source folder --input " + In("in") + " --out " + In("out"));
    ExpectIn(Ok(ReadText(folder_ / "out/rejected.jsonl")).value(), file);
    for (const char* folder : {"in", "out"}) std::filesystem::remove_all(folder_ / folder);
  }
  void Save(const std::string& name, const ImageU8& image) const {
    Ok(io::SavePng(folder_ / name, image));
  }
  std::string Predict(const std::string& image, const std::string& more = "") const {
    return "predict --run " + Run() + " --out " + folder_.string() + " " + In(image) + more;
  }
  std::string Train(const std::string& data, const std::string& config = "quick") const {
    return TrainTiny(data, In("new"), config);
  }
  std::string Copy(const std::string& from, const std::string& to) const {
    std::filesystem::remove_all(folder_ / to);
    std::filesystem::copy(from, folder_ / to, std::filesystem::copy_options::recursive);
    return In(to);
  }

  static inline Path shared_;
};

std::string Text(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }

std::string Replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

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
  const ImageU8 image(8, 8, 4, 255);
  Save("opaque.png", image);
  ExpectError(Predict("opaque.png"), "opaque.png", "mask");
  Save("rgb.png", ImageU8(8, 8, 3, 9));
  ExpectError(Predict("rgb.png"), "rgb.png", "transparent background");
  ExpectError(Predict("rgb.png", " --mask " + In("opaque.png")), "not cut out");
  Save("small.png", ImageU8(4, 4, 1, 255));
  ExpectError(Predict("rgb.png", " --mask " + In("small.png")), "4 x 4", "8 x 8");
  Save("clear.png", ImageU8(8, 8, 4, 0));
  ExpectError(Predict("clear.png"), "clear.png", "no pixel");
  Bytes png = io::EncodePng(image).value();
  Write("cut.png", Bytes(png.begin(), png.begin() + 40));
  png[16] = 0x7f;
  Write("lie.png", png);
  for (const char* name : {"cut.png", "lie.png", "none.png"}) ExpectError(Predict(name), name);
}

TEST_F(BrokenInputs, ConfigurationsAndCommandLines) {
  Write("key.toml", "[network]\nchanels = 3\n");
  ExpectError(Train(Data(), In("key.toml")), "key.toml", "line 2", "network.channels");
  Write("range.toml", "[schedule]\nbatch = -1\n");
  ExpectError(Train(Data(), In("range.toml")), "line 2", "schedule.batch");
  ExpectError(Train(Data(), In("none.toml")), "none.toml");
  ExpectError(Train(In("nowhere")), "nowhere: no such folder");
  ExpectError("train --config quick --data " + Data() + " --out " + Run(), "--resume");
  ExpectError("dance", "dance");
  ExpectError("predict --run " + folder_.string() + " x.png", folder_.string());
  ::setenv("TILEGRAD_TARGET", "AVX9", 1);
  ExpectError("info", "AVX9", RunnableTargets().back());
  ::unsetenv("TILEGRAD_TARGET");
}

TEST_F(BrokenInputs, DatasetsAndCheckpoints) {
  Copy(Data(), "copy");
  Write("copy/dataset.json", "{\"format\": 1,");
  ExpectError(Train(In("copy")), "dataset.json");
  Copy(Data(), "copy");
  Write("copy/models.jsonl", "nonsense\n");
  ExpectError(Train(In("copy")), "models.jsonl", "line 1");
  Copy(Data(), "copy");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(In("copy/models"))) {
    if (entry.path().extension() == ".npz") std::filesystem::resize_file(entry.path(), 100);
  }
  ExpectError(Train(In("copy")), ".npz");
  for (const auto& entry :
       std::filesystem::directory_iterator(Copy(Run(), "half") + "/checkpoints")) {
    std::filesystem::resize_file(entry.path(), entry.file_size() / 2);
  }
  ExpectError("predict --run " + In("half") + " x.png", "half", "step_");
}

TEST_F(BrokenInputs, SeveralImagesOneOfThemBad) {
  ImageU8 image(8, 8, 4, 255);
  Save("opaque.png", image);
  image.at(0, 0)[3] = 0;
  for (const char* name : {"a/x.png", "b/x.png"}) Save(name, image);
  ExpectRefused(
      Predict("none.png", " " + In("a/x.png") + " " + In("b/x.png") + " " + In("opaque.png")),
      3);  // the first one's: missing
  // Two images of one name are two meshes.
  for (const char* name :
       {"x_predicted.glb", "x_turntable.png", "x_2_predicted.glb", "x_2_turntable.png"})
    EXPECT_TRUE(Exists(name)) << name;
}

TEST_F(BrokenInputs, DatasetsOfOtherFoldersOrSplits) {
  const std::string copy = Copy(Data(), "copy"), eval = "eval --run " + Copy(Run(), "run");
  std::string models = Replaced(ReadText(copy + "/models.jsonl").value(), "\"train\"", "\"test\"");
  Write("copy/models.jsonl", models);
  for (const std::string command : {"eval", "report"}) {
    ExpectError(command + " --run " + In("run") + " --data " + copy, "trained on", "split anew");
  }
  Write("copy/models.jsonl", Replaced(models, "\"test\"", "\"validation\""));
  const std::string none = copy + ": its test split has no models";
  ExpectError(eval + " --data " + copy, none);
  ExpectDone("dataset-view --split validation --data " + copy + " --out " + In("view.png"));
  const std::string json = ReadText(In("run/run.json")).value();
  ExpectIn(json, Data());
  Write("run/run.json", Replaced(json, Data(), "elsewhere"));
  ExpectError(eval, "elsewhere", "--data");
  // A relative name is also looked for in the folders above the run.
  Write("run/run.json", Replaced(json, Data(), "copy"));
  ExpectError(eval, none);
}

TEST_F(BrokenInputs, DatasetsOfAnotherImageSize) {
  const std::string data = In("large");
  ExpectDone("dataset --source procedural --per-class 2 --size 32 --views 3 --seed 9 --out " +
             data);
  for (const std::string command : {"eval", "report"}) {
    ExpectError(command + " --run " + Run() + " --data " + data,
                data + ": images are 32 pixels a side, the network was trained on 16");
  }
}

TEST_F(BrokenInputs, OutputThatCannotBePrinted) {
  ExpectRefused("info > /dev/full", 1);
  ExpectRefused("render none.obj 2> /dev/full; exit $?", 3);
  // Nor does training end for want of its progress line, which comes after two seconds; and that
  // does not go into files where the stream is closed.
  for (const std::string streams : {"2> /dev/full; exit $?", "<&- 2>&-; exit $?"}) {
    const Path out = folder_ / std::to_string(streams.size());
    ExpectDone(TrainTiny(Data(), out.string()) + " --steps 100000 --max-minutes 0.05 " + streams);
    ExpectNotIn(ReadText(out / "metrics.jsonl").value(), "training");
    EXPECT_FALSE(std::filesystem::is_empty(out / "checkpoints"));
  }
}

TEST_F(BrokenInputs, OptionsThatMeanSomethingElse) {
  ExpectError("dataset-view --data " + Data() + " --out " + In("view.jpg"), "view.jpg", ".png");
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  ExpectError("dataset --source procedural --seed -1 --out " + In("d"), "--seed");
  ExpectError("fit " + Data() + " --seed -1", "--seed");
  ExpectError("fit " + Data() + " --out " + In("fit"), "--model");
  ExpectError("fit " + Data() + "/dataset.json --out " + In("fit"), "is a file; give the folder");
}

TEST_F(BrokenInputs, OptionsThatWouldDoNothing) {
  const std::string fit = "fit " + folder_.string() + " --out " + In("fit");
  ExpectError(fit + " --light-direction 0 0 1", "--light-direction", "--lighting");
  ExpectError(fit + " --rate camera=0.1", "camera is not fitted", "--optimize");
  ExpectError(fit + " --rate uv=0.1 --optimize texture", "uv is not fitted");
  ExpectError(fit + " --rate texture=1e6 --optimize texture", "[0, 1000000)");
  ExpectError(fit + " --rate texture=0.1 --optimize texture", "transforms.json");  // no images
  const std::string dataset = "dataset --out " + In("d");
  ExpectError(dataset + " --source procedural --split-list a", "--split-list", "shapenet");
  ExpectError(dataset + " --source procedural --input a", "--input", "procedural");
  ExpectError(dataset + " --source nmr --input a --test-share 0.1", "--test-share", "fixed split");
  ExpectError(dataset + " --source shapenet --input a --split-list b --validation-share 0.1",
              "--validation-share", "--split-list");
  ExpectError("dataset-view --data " + Data() + " --model a --class b", "--class", "--model");
}

// What the program writes into a run's folder when it looks at it does not make the run newer.
TEST_F(BrokenInputs, TheNewestRunIsTheOneThatWasTrainedLast) {
  using std::filesystem::last_write_time;
  Write("runs/started/run.json", "{}");
  for (const char* name : {"runs/old", "runs/new"}) Copy(Run(), name);
  const auto now = last_write_time(folder_ / "runs/new/run.json");
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "runs/old/checkpoints"))
    last_write_time(entry.path(), now - std::chrono::hours(1));
  last_write_time(folder_ / "runs/old", now + std::chrono::hours(1));
  const std::string here = "cd " + folder_.string() + " && ";
  ExpectIn(ExpectDone("report", here), "runs/new: using the newest run");
  for (const char* run : {"runs/new", "runs/old"}) std::filesystem::remove_all(folder_ / run);
  EXPECT_EQ(RunProgram("report", here).exit_code, 3);
}

// 3: what is to be read is missing; 1: what is to be written cannot be.
TEST_F(BrokenInputs, ExitCodesOfPlaces) {
  Write("file", "in the way");
  const std::string file = In("file");
  ExpectRefused("eval --run " + file, 3, file + ": not a run folder");
  ExpectRefused("eval --run " + folder_.string(), 3, "no run.json");
  ExpectRefused(Train(Data(), file + "/a.toml"), 3, "a.toml");
  ExpectRefused("report --run " + Run() + " --out /proc/a.html", 1, "/proc/a.html: ");
  ExpectRefused(TrainTiny(Data(), "''"), 2, "is empty");
  ExpectError("dataset --source procedural --per-class 1 --size 16 --out " + file + "/x", "file");
  ExpectError(TrainTiny(Data(), file + "/x"), "file");
  EXPECT_EQ(ReadText(file).value(), "in the way");
}

// A variable that was not set is neither the current folder nor the newest run.
TEST_F(BrokenInputs, EmptyValues) {
  const auto expect = [](const std::string& arguments, const std::string& message) {
    const Outcome outcome = RunProgram(arguments, "cd " + Data() + " && ");
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_EQ(outcome.output, "tilegrad: " + message + ": the value is empty\n");
  };
  expect(Train("''"), "--data");
  expect("eval --run " + Run() + " --data ''", "--data");
  expect("eval --run ''", "--run");
  expect("views '' --out " + folder_.string(), "mesh");
}

// The files of an evaluation are there even if its table goes nowhere: nothing is kept in memory
// here until the end, so that the first words fail.
TEST_F(BrokenInputs, AnEvaluationThatCannotBePrintedIsWritten) {
  const std::string run = " --run " + Copy(Run(), "run");
  ExpectRefused("--version > /dev/null; stdbuf -o0 " TILEGRAD_PROGRAM " eval" + run +
                    " --views-per-model 1 2>&1 > /dev/full; exit $?",
                1, "tilegrad: standard output: No space left");
  for (const char* name : {"run/eval.json", "run/eval.md"}) EXPECT_TRUE(Exists(name)) << name;
  ExpectDone("report" + run);
}

// Names of files and classes that try to be more than names, and what killed commands leave.

constexpr const char* kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n";

class HostileNames : public ProgramTest {
 protected:
  std::string Quoted(const std::string& name) const { return "'" + In(name) + "'"; }

  // The control sequence is seen, not obeyed.
  void ExpectShown(const std::string& arguments, const std::string& shown) {
    const std::string said = RunProgram(arguments).output;
    ExpectNotIn(said, "\x1b", "\x07", "\xc2\x9b");
    ExpectIn(said, shown);
  }
};

TEST_F(HostileNames, AreShownOnTheTerminalNotObeyed) {
  Write("in/x\x1b[31mred/a.obj", kTriangle);
  Write("in/fine/b\x07.obj", kTriangle);
  Write("bad\xc2\x9b.obj", "v nonsense\n");
  ExpectShown("render " + Quoted("bad\xc2\x9b.obj"), "bad\\x9b.obj");
  ExpectShown("render " + Quoted("no\x1b[2J.obj"), "no\\x1b[2J.obj");
  ExpectShown("dataset --source folder --size 16 --views 1 --input " + Quoted("in") + " --out " +
                  Quoted("da\x1bta"),
              "da\\x1bta");
  ExpectShown("info 'x\x1b[31m'", "x\\x1b[31m");  // the option parser's own words
  ExpectShown("\x1b[5m", "\\x1b[5m");
}

TEST_F(HostileNames, AreTextInMarkdownAndOneFieldInCsv) {
  const std::string name = "<img src=x onerror=alert(1)>, |a| [b](c).obj";
  Write(name, kTriangle);
  ExpectDone("tradeoff " + Quoted(name) + " --size 16 --repetitions 1 --out " + Quoted("out") +
             " --errors 0.1 --deltas 0.01");
  const std::string text = ReadText(folder_ / "out/tradeoff.md").value();
  ExpectNotIn(text, "<img");
  ExpectIn(text, "&lt;img src=x onerror=alert(1)&gt;, \\|a\\| \\[b\\](c)");
  ExpectIn(ReadText(folder_ / "out/tradeoff.csv").value(), "\n\"<img");
}

// A dataset of a stranger: its texts reach the pages and tables of every run that uses it.
TEST_F(HostileNames, AreTextInReportsAndTables) {
  const std::string data = Quoted("data"), run = Quoted("run");
  const auto done = [](const std::string& arguments) {
    ExpectNotIn(ExpectDone(arguments), "\x1b");
  };
  MakeData(data);
  const std::string hostile =
      R"(</script><img src=x onerror=alert(1)>\"'|\n# \u202e\u001b[31m)";  // as JSON writes it
  for (const auto& [file, key] : {std::pair{"data/models.jsonl", "\"name\":\""},
                                  {"data/models.jsonl", "\"creator\":\""},
                                  {"data/models.jsonl", "\"license\":\""},
                                  {"data/dataset.json", "\"credits\": [\n    \""},
                                  {"data/dataset.json", "\"source\": \""}}) {
    std::string text = ReadText(folder_ / file).value();
    ASSERT_NE(text.find(key), std::string::npos) << file << ": " << key << "\n" << text;
    for (std::size_t at = 0; (at = text.find(key, at)) != std::string::npos;) {
      at += std::string_view(key).size();
      text.insert(at, hostile);
    }
    Write(file, text);
  }
  done(TrainTiny(data, run));
  done("eval --run " + run + " --views-per-model 1");
  done("report --run " + run + " --models 2");
  for (const char* file : {"run/report.html", "run/eval.md"})
    ExpectNotIn(ReadText(folder_ / file).value(), "<img src=x", "\u202e", "\x1b");
  ExpectIn(ReadText(folder_ / "run/report.html").value(), "&lt;img src=x onerror=alert(1)&gt;");
}

// Names of folders are bytes; JSON is UTF-8. What is written finds its files again.
TEST_F(HostileNames, OfDatasetsNeedNotBeUtf8) {
  const std::string data = "caf\xe9 \xee\xbf\xa9", run = Quoted("run\xff");  // the last is U+EFE9
  const std::string said = ExpectDone(
      "dataset --source procedural --per-class 2 --size 16 --views 2 --json --out " + Quoted(data));
  const auto json = nlohmann::json::parse(said.substr(said.find('{')));
  EXPECT_EQ(NameFromJson(json.at("folder").get<std::string>()), In(data));
  MakeRun(Quoted(data), run);
  EXPECT_TRUE(IsUtf8(ReadText(folder_ / "run\xff/run.json").value()));
  ExpectDone("train --resume " + run + " --steps 3");
  ExpectDone("eval --run " + run + " --views-per-model 1");
  ExpectDone("report --run " + run + " --models 1");
  EXPECT_TRUE(Exists("run\xff/report.html"));
  ASSERT_TRUE(io::SaveGlb(folder_ / "truth.glb", Icosphere(1, 1)).ok());
  ExpectDone("views " + Quoted("truth.glb") + " --views 3 --held-out 0 --size 16 --out " +
             Quoted("v\xfe"));
  ExpectDone("fit " + Quoted("v\xfe") + " --steps 1 --out " + Quoted("f\xfd"));
  ExpectDone("fit --resume --steps 2 --out " + Quoted("f\xfd"));
}

// Half-written files of processes that are gone; those of others, and other files, stay.
TEST_F(HostileNames, TemporariesOfKilledCallsGo) {
  const std::string data = Quoted("data"), run = Quoted("run");
  MakeData(data);
  MakeRun(data, run);
  const std::string gone = ".4194305.tmp", own = "." + std::to_string(::getpid()) + ".tmp";
  std::vector<Path> left;
  for (const std::string name :
       {"run/eval.md", "run/eval.json", "run/report.html", "run/summary.png",
        "out/view_predicted.glb", "out/view_turntable.png", "out/view_turntable.webp",
        "out/view_match.png", "out/view_match.json", "out/view.png", "out/drawn.png",
        "out/drawn_depth.png", "out/cameras.json", "out/colmap/images.txt"}) {
    left.push_back(Write(name + gone, "half"));
  }
  const Path kept[] = {Write("run/eval.md" + own, "of a process that runs"),
                       Write("run/notes" + gone, "another's"),
                       Write("run/eval.md.tmp", "another's")};
  ExpectDone("eval --run " + run + " --views-per-model 1");
  ExpectDone("report --run " + run + " --models 1");
  const std::string view = Quoted("out/view.png"), out = Quoted("out");
  ExpectDone("dataset-view --data " + data + " --split train --out " + view);
  ExpectDone("predict --run " + run + " --refine 1 --out " + out + " " + view);
  const std::string render = "render " + Quoted("out/view_predicted.glb") +
                             " --size 8 --outputs color,depth --out " + Quoted("out/drawn.png") +
                             " --write-cameras ";
  ExpectDone(render + Quoted("out/cameras.json"));
  ExpectDone(render + Quoted("out/colmap") + " --force");
  for (const Path& file : left) EXPECT_FALSE(std::filesystem::exists(file)) << file;
  for (const Path& file : kept) EXPECT_TRUE(std::filesystem::exists(file)) << file;
}

}  // namespace tilegrad::broken_inputs_test

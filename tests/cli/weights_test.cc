// SPDX-License-Identifier: Apache-2.0
// Files of weights: exported from runs, taken in their place, and found by name or where nothing is
// named.
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "nn/serialize.h"
#include "support/run_program.h"

namespace tilegrad::weights_test {

using Json = nlohmann::json;

// Data, a run of each kind and their weights, for all tests.
class Weights : public ProgramTest {
 protected:
  static void SetUpTestSuite() {
    shared_ = Path(testing::TempDir()) / ("tilegrad_weights_" + std::to_string(::getpid()));
    std::filesystem::create_directories(shared_ / "weights");
    MakeData(Shared("d"));
    MakeRun(Shared("d"), Shared("image"));
    ASSERT_TRUE(WriteTextAtomic(shared_ / "gan.toml", kTwoStepGan).ok());
    ExpectDone("train --config " + Shared("gan.toml") + " --data " + Shared("d") + " --out " +
               Shared("gan"));
    Export("image", "weights/furniture.safetensors", " --half");
    Export("gan", "weights/car-generator.safetensors", " --half");
    Export("image", "full.safetensors");
    ExpectDone("dataset-view --data " + Shared("d") + " --out " + Shared("view.png"));
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(shared_); }

  static std::string Shared(const std::string& name) { return (shared_ / name).string(); }
  static void Export(const std::string& run, const std::string& out, const std::string& how = "") {
    ExpectDone("export --run " + Shared(run) + " --out " + Shared(out) + how);
  }
  // In a folder without runs, with the weights of the tests.
  std::string Alone() const {
    return "cd " + folder_.string() + " && TILEGRAD_WEIGHTS=" + Shared("weights") + " ";
  }
  Bytes Predicted(const std::string& run) const {
    ExpectDone("predict --refine 5 --force --run " + run + " --out " + In("out") + " " +
               Shared("view.png"));
    return ReadFile(folder_ / "out/view_predicted.glb").value();
  }
  static Json JsonOf(const std::string& said) {
    return Json::parse(said.substr(said.find('{'), said.rfind('}') + 1 - said.find('{')));
  }
  static Json Scores(const std::string& run, const std::string& more = "") {
    return JsonOf(ExpectDone("eval --views-per-model 1 --json --run " + run + " --data " +
                             Shared("d") + more));
  }

 private:
  static inline Path shared_;
};

TEST_F(Weights, PredictAsTheirRunDoes) {
  const Bytes of_run = Predicted(Shared("image"));
  EXPECT_EQ(Predicted(Shared("full.safetensors")), of_run);
  EXPECT_NE(Predicted(Shared("weights/furniture.safetensors")), of_run);  // rounded
}

TEST_F(Weights, HoldWhatPredictsAndWhoseDataItWas) {
  const Workers workers(1);
  nn::Context context(workers);
  const auto full = nn::ReadSafetensors(context, Shared("full.safetensors")).value();
  const auto half = nn::ReadSafetensors(context, Shared("weights/furniture.safetensors")).value();
  const Path run = Shared("image/checkpoints/step_00000002.safetensors");
  EXPECT_LT(full.tensors.size(), nn::ReadSafetensors(context, run).value().tensors.size());
  ASSERT_EQ(full.tensors.size(), half.tensors.size());
  for (std::size_t i = 0; i < full.tensors.size(); ++i) {
    EXPECT_EQ(full.tensors[i].name, half.tensors[i].name);
    EXPECT_EQ(full.tensors[i].value.shape(), half.tensors[i].value.shape());
  }
  ExpectIn(half.metadata.at("credits"), "Parametric models of tilegrad");
  ExpectIn(half.metadata.at("config"), "channels = 2");
  EXPECT_EQ(half.metadata.at("step"), "2");
  const auto size = [](const Path& file) { return std::filesystem::file_size(file); };
  EXPECT_LT(size(Shared("weights/furniture.safetensors")), size(Shared("full.safetensors")));
}

TEST_F(Weights, AreScoredBesideTheirRun) {
  const Json of_run = Scores(Shared("image")), full = Scores(Shared("full.safetensors")),
             half = Scores(Shared("weights/furniture.safetensors"));
  EXPECT_EQ(full["rows"], of_run["rows"]);
  EXPECT_NEAR(half["rows"].back()["mean"]["iou"].get<double>(),
              of_run["rows"].back()["mean"]["iou"].get<double>(), 0.02);
  ExpectNotIn(ExpectDone("eval --views-per-model 1 --run " + Shared("full.safetensors") +
                         " --data " + Shared("d")),
              "written to");
  // A checkpoint knows its run, and with it the dataset.
  EXPECT_EQ(JsonOf(ExpectDone("eval --views-per-model 1 --json --run " +
                              Shared("image/checkpoints/step_00000002.safetensors")))["rows"],
            of_run["rows"]);
  ExpectRefused("eval --run " + Shared("full.safetensors"), 3, "names no dataset", "--data");
}

// They carry the list of the models that they learned from.
TEST_F(Weights, AreNotScoredOnWhatTheyLearnedFrom) {
  std::filesystem::copy(Shared("d"), folder_ / "d", std::filesystem::copy_options::recursive);
  std::istringstream lines(ReadText(folder_ / "d/models.jsonl").value());
  std::string swapped;
  for (std::string line; std::getline(lines, line);) {
    Json model = Json::parse(line);
    model["split"] = model["split"] == "train" ? "test" : "train";
    swapped += model.dump() + "\n";
  }
  Write("d/models.jsonl", swapped);
  ExpectRefused("eval --run " + Shared("weights/furniture.safetensors") + " --data " + In("d"), 2,
                "held-out models", "were trained on");
}

TEST_F(Weights, OfARunWithoutItsListAreScoredWithAWarning) {
  std::filesystem::copy(Shared("image"), folder_ / "run", std::filesystem::copy_options::recursive);
  const std::string on = " --run " + In("run") + " --data " + Shared("d");
  const std::string eval = "eval --views-per-model 1" + on, list = "training_models.txt";
  ExpectNotIn(ExpectDone(eval), list);
  std::filesystem::remove(folder_ / "run" / list);
  ExpectIn(ExpectDone("report --models 1" + on), "warning: " + In("run"), list);
  ExpectNotIn(ExpectDone(eval + " --split train"), list);
  // The scores are told even where they cannot be saved.
  std::filesystem::remove(folder_ / "run/eval.json");
  Write("run/eval.json/in_the_way", "x");
  ExpectError(eval, "warning: " + In("run"), list, "3D IoU at 32^3", "eval.json: cannot");
}

TEST_F(Weights, ComeAlongByName) {
  const std::string to = " --refine 0 --out " + In("out") + " " + Shared("view.png");
  ExpectDone("predict --run furniture" + to, Alone());
  const Bytes named = ReadFile(folder_ / "out/view_predicted.glb").value();
  ExpectIn(ExpectDone("predict --force" + to, Alone()),
           "using the installed weights \"furniture\"");
  EXPECT_EQ(ReadFile(folder_ / "out/view_predicted.glb").value(), named);
  ExpectIn(ExpectDone("sample --count 2 --out " + In("s"), Alone()), "\"car-generator\"");
  EXPECT_TRUE(Exists("s/sample_002.glb"));
  // A run goes before them.
  std::filesystem::create_directory(folder_ / "runs");
  std::filesystem::create_directory_symlink(Shared("image"), folder_ / "runs/image");
  ExpectIn(ExpectDone("predict --force" + to, Alone()), "using the newest run below runs/");
  // As does a folder of that name.
  std::filesystem::create_directory_symlink(Shared("gan"), folder_ / "furniture");
  ExpectIn(RunProgram("predict --run furniture --force" + to, Alone()).output,
           "furniture: this network predicts no meshes");
}

// Those of data/weights, which are installed.
TEST_F(Weights, OfTheRepositoryPredictAndSample) {
  const std::string installed = "cd " + folder_.string() + " && env -u TILEGRAD_WEIGHTS ";
  const std::string to = " --refine 0 --out " + In("out") + " " + Shared("view.png");
  ExpectIn(ExpectDone("predict" + to, installed), "share/tilegrad/weights/furniture.safetensors");
  EXPECT_TRUE(Exists("out/view_predicted.glb"));
  ExpectIn(ExpectDone("sample --count 2 --out " + In("cars"), installed),
           "share/tilegrad/weights/car-generator.safetensors");
  EXPECT_TRUE(Exists("cars/sample_002.glb"));
}

TEST_F(Weights, ThatAreMissingAreToldOf) {
  const std::string to = " --out " + In("out") + " " + Shared("view.png");
  ExpectRefused(RunProgram("predict --run cars" + to, Alone()), 3,
                "cars: no run or file has that path", "there are car-generator, furniture");
  const std::string nowhere = "cd " + folder_.string() + " && TILEGRAD_WEIGHTS=" + In("none") + " ";
  for (const char* command : {"predict", "sample"}) {
    const std::string line = command + (std::string(command) == "predict" ? to : " --out x");
    ExpectRefused(RunProgram(line, nowhere), 3, "no run with a checkpoint below runs/",
                  "no weights are installed", In("none"));
  }
}

// As after an installation.
TEST_F(Weights, LieAboveTheProgram) {
  std::filesystem::create_directories(folder_ / "bin");
  std::filesystem::copy_file(TILEGRAD_PROGRAM, folder_ / "bin/tilegrad");
  std::filesystem::create_directories(folder_ / "share/tilegrad/weights");
  std::filesystem::copy_file(Shared("weights/furniture.safetensors"),
                             folder_ / "share/tilegrad/weights/furniture.safetensors");
  const std::string line = "cd " + folder_.string() +
                           " && bin/tilegrad predict --refine 0 --out out " + Shared("view.png");
  EXPECT_EQ(std::system(line.c_str()), 0);
  EXPECT_TRUE(Exists("out/view_predicted.glb"));
}

TEST_F(Weights, AreWrittenAsOtherFilesAre) {
  const std::string run = "export --run " + Shared("image") + " --out ";
  ExpectRefused(run + Shared("full.safetensors"), 2, "--force");
  ExpectRefused(run + In("a.bin"), 2, ".safetensors");
  const Json said = JsonOf(ExpectDone(run + In("a.safetensors") + " --half --json --credits me"));
  EXPECT_EQ(said["credits"], "me");
  EXPECT_EQ(said["bytes"], std::filesystem::file_size(folder_ / "a.safetensors"));
  // Weights of weights are the same.
  ExpectDone("export --run " + In("a.safetensors") + " --half --credits me --out " +
             In("b.safetensors"));
  EXPECT_EQ(ReadFile(folder_ / "a.safetensors").value(),
            ReadFile(folder_ / "b.safetensors").value());
  ExpectRefused("export --run " + In("a.safetensors") + " --out " + In("c.safetensors"), 3,
                "names no dataset", "--credits");
  ExpectNotIn(ExpectDone(run + "/dev/null --force --credits me"), " MB");  // has no size
  // A failure names the file once.
  std::filesystem::create_directory(folder_ / "taken.safetensors");
  ExpectNotIn(RunProgram(run + In("taken.safetensors") + " --force --credits me").output,
              In("taken.safetensors") + ": " + In("taken.safetensors"));
  // A bit that changed is noticed.
  std::string text = ReadText(folder_ / "a.safetensors").value();
  text.back() = static_cast<char>(text.back() ^ 1);
  Write("a.safetensors", text);
  ExpectRefused("predict --run " + In("a.safetensors") + " " + Shared("view.png"), 3, "checksum");
}

TEST_F(Weights, OfEveryTaskAreWhole) {
  ExpectDone("train --config " TILEGRAD_CONFIGS "/classify.toml --data " + Shared("d") + " --out " +
             In("c") + " --set schedule.steps=1 --set schedule.batch=2 --set schedule.portions=1");
  ExpectDone("export --run " + In("c") + " --out " + In("c.safetensors"));
  EXPECT_EQ(Scores(In("c.safetensors"))["rows"], Scores(In("c"))["rows"]);
}

// Of a training of the same kind.
TEST_F(Weights, AreAStart) {
  ExpectDone("train --config " + Shared("gan.toml") + " --data " + Shared("d") + " --out " +
                 In("g") + " --set start.run=car-generator",
             Alone());
}

}  // namespace tilegrad::weights_test

// SPDX-License-Identifier: Apache-2.0
// Nothing is overwritten, whatever the command: what stands there stays byte for byte until
// --force, and what is read stays with it, too. A run's own folder knows its own files.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/simd_target.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::outputs_test {

class Outputs : public ProgramTest {
 protected:
  void SetUp() override {
    // fuze.obj, its material and its texture, all of one stem.
    ASSERT_TRUE(io::SavePng(folder_ / "fuze.png", ImageU8(2, 2, 3)).ok());
    Write("fuze.mtl", "newmtl m\nmap_Kd fuze.png\n");
    Write("fuze.obj",
          "mtllib fuze.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"
          "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
  }
  // In the folder, as RunProgram starts the program where the test is.
  Outcome Run(const std::string& arguments) const {
    return RunProgram(arguments, "cd '" + folder_.string() + "' && ");
  }
  void ExpectDone(const std::string& arguments) const {
    ProgramTest::ExpectDone(arguments, "cd '" + folder_.string() + "' && ");
  }
  // ... and `file` is what it was.
  void ExpectKept(const std::string& file, const std::string& arguments,
                  const std::string& part) const {
    const std::string before = ReadText(folder_ / file).value();
    SCOPED_TRACE(arguments);
    ExpectRefused(Run(arguments), 2, part);
    EXPECT_EQ(ReadText(folder_ / file).value(), before);
  }
};

TEST_F(Outputs, DefaultNamesCannotBeThoseOfTextures) {
  const std::string texture = ReadText(folder_ / "fuze.png").value();
  ExpectDone("render fuze.obj --size 8");
  EXPECT_TRUE(Exists("fuze_render.png"));
  EXPECT_EQ(ReadText(folder_ / "fuze.png").value(), texture);
  ExpectDone("render fuze.obj --size 8 --turntable 2 --outputs color,depth");
  EXPECT_TRUE(Exists("fuze_render_0001.png"));
  EXPECT_TRUE(Exists("fuze_render_0001_depth.png"));
}

TEST_F(Outputs, PicturesAreReplacedByForceAlone) {
  for (const std::string name : {"a.png", "a.exr", "a.npy"}) {
    ExpectDone("render fuze.obj --size 8 --out " + name);
    ExpectKept(name, "render fuze.obj --size 9 --out " + name, name + ": exists; --force");
    Write(name, std::string("mine"));
    ExpectDone("render fuze.obj --size 8 --force --out " + name);
    EXPECT_NE(ReadText(folder_ / name).value(), "mine");
  }
  Write("turn/fuze_0001.png", "mine");
  ExpectKept("turn/fuze_0001.png", "render fuze.obj --size 8 --turntable 2 --out turn", "--force");
  EXPECT_FALSE(Exists("turn/fuze_0000.png"));  // before the first is rendered
  Write("b_depth.png", "mine");
  ExpectKept("b_depth.png", "render fuze.obj --size 8 --outputs color,depth --out b.png",
             "--force");
}

TEST_F(Outputs, InputsAreNotReplacedEvenByForce) {
  std::filesystem::create_symlink("fuze.png", folder_ / "soft.png");
  std::filesystem::create_hard_link(folder_ / "fuze.png", folder_ / "hard.png");
  for (const std::string name : {"fuze.png", "soft.png", "hard.png", "x/../fuze.png"}) {
    std::filesystem::create_directories(folder_ / "x");
    ExpectKept("fuze.png", "render fuze.obj --size 8 --force --out " + name,
               "is an input of this command");
  }
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "soft.png"));
  ExpectKept("fuze.png", "render fuze.obj --size 8 --force --out .", "is an input of this command");
}

TEST_F(Outputs, CamerasAreNotReplaced) {
  ExpectDone("render fuze.obj --size 8 --out a.png --write-cameras transforms.json");
  ExpectKept("transforms.json",
             "render fuze.obj --size 8 --out b.png --write-cameras transforms.json",
             "transforms.json: exists");
  EXPECT_FALSE(Exists("b.png"));  // before anything is rendered
  ExpectKept("transforms.json",
             "render fuze.obj --size 8 --force --out a.png --cameras transforms.json "
             "--write-cameras transforms.json",
             "is an input of this command");
  Write("sparse/images.txt", "# mine\n");
  ExpectKept("sparse/images.txt", "render fuze.obj --size 8 --out b.png --write-cameras sparse",
             "--force");
  EXPECT_FALSE(Exists("sparse/cameras.txt"));
  ExpectDone("render fuze.obj --size 8 --out a.png --write-cameras sparse --force");
}

TEST_F(Outputs, ViewsFillAFolderOfTheirOwn) {
  const std::string views = "views fuze.obj --views 2 --held-out 0 --size 8 --out ";
  Write("photos/me.jpg", "mine");
  ExpectKept("photos/me.jpg", views + "photos", "--force");
  EXPECT_FALSE(Exists("photos/truth.glb"));
  ExpectDone(views + "photos --force");
  EXPECT_TRUE(Exists("photos/me.jpg"));
  Write("photos/images/001.png", "retouched");
  ExpectKept("photos/images/001.png", views + "photos", "--force");
  ExpectDone(views + "photos --force");
  EXPECT_NE(ReadText(folder_ / "photos/images/001.png").value(), "retouched");
}

// Before a second of work; --force starts anew, --resume goes on.
TEST_F(Outputs, FitsStartAnewOrGoOn) {
  ExpectDone("views fuze.obj --views 2 --held-out 0 --size 8 --out v");
  const std::string fit = "fit v --template-level 1 --texture-size 8 --steps ";
  Write("f/me.jpg", "mine");
  ExpectKept("f/me.jpg", fit + "2 --out f", "--force");
  ExpectDone(fit + "2 --out f --force");
  EXPECT_TRUE(Exists("f/me.jpg"));
  ExpectKept("f/mesh.glb", fit + "2 --out f", "f: already holds a run; --resume continues it");
  // The images are not even looked at.
  ExpectKept("f/mesh.glb", "fit nowhere --out f", "already holds a run");
  ExpectKept("f/mesh.glb", fit + "2 --out f --force --resume",
             "--force and --resume exclude each other");
  ExpectDone(fit + "1 --out f --force");
  EXPECT_TRUE(Exists("f/checkpoints/step_00000001.safetensors"));
  EXPECT_FALSE(Exists("f/checkpoints/step_00000002.safetensors"));
  EXPECT_FALSE(Exists("f/timelapse/00000002.png"));
  Write("f/report.html", "of the run");
  ExpectDone(fit + "3 --out f --resume");
  EXPECT_NE(ReadText(folder_ / "f/report.html").value(), "of the run");
  EXPECT_TRUE(Exists("f/me.jpg"));
  ExpectRefused(Run(fit + "1 --out nowhere --resume"), 3, "nowhere: no checkpoint to resume");
  EXPECT_FALSE(Exists("nowhere"));
  const std::string from_itself = fit + "3 --out f --mesh f/mesh.glb";
  ExpectKept("f/mesh.glb", from_itself + " --force", "is an input of this command");
  ExpectKept("f/mesh.glb", from_itself + " --resume", "leave it out to resume");
}

TEST_F(Outputs, DatasetsAndRuns) {
  const std::string dataset = "dataset --source procedural --per-class 1 --views 1 --size ";
  Write("d/thesis.txt", "mine");
  ExpectKept("d/thesis.txt", dataset + "8 --out d", "--force");
  ExpectDone(dataset + "8 --out d --force");
  ExpectDone(dataset + "8 --out d");  // it goes on in its own
  ExpectKept("d/dataset.json", dataset + "9 --out d", "with other settings");
  ExpectDone(dataset + "9 --out d --force");
  EXPECT_TRUE(Exists("d/thesis.txt"));
  Write("view.png", "mine");
  const std::string view = "dataset-view --split train --data d";
  ExpectKept("view.png", view, "--force");
  ExpectDone(view + " --force");
  Write("r/notes.txt", "mine");
  ExpectKept("r/notes.txt", "train --config " TILEGRAD_CONFIGS "/quick.toml --data d --out r",
             "--force");
}

TEST_F(Outputs, RunsStartAnewOrGoOn) {
  MakeData(In("d"));
  const std::string train = TrainTiny("d", "r") + " --steps ";
  ExpectDone(train + "2");
  ExpectDone("eval --run r --views-per-model 1");
  Write("r/notes.txt", "mine");
  ExpectKept("r/config.toml", train + "1", "already holds a run");
  // What is wrong is said while the run is still there.
  const Outcome wrong = Run(train + "1 --force --data nowhere");
  EXPECT_NE(wrong.exit_code, 0);
  EXPECT_TRUE(Exists("r/checkpoints/step_00000002.safetensors"));
  ExpectDone(train + "1 --force");
  EXPECT_TRUE(Exists("r/notes.txt"));
  EXPECT_FALSE(Exists("r/checkpoints/step_00000002.safetensors"));
  EXPECT_FALSE(Exists("r/eval.json"));  // of other weights
}

TEST_F(Outputs, ScoresOnOtherDataHaveFilesOfTheirOwn) {
  MakeData(In("d"));
  MakeRun(In("d"), In("r"));
  ExpectDone("dataset --source procedural --per-class 2 --size 16 --views 3 --seed 3 --out other");
  const std::string eval = "eval --run r --views-per-model 1";
  ExpectDone(eval);
  const std::string own = ReadText(folder_ / "r/eval.json").value();
  ExpectRefused(Run(eval + " --data other --compare r"), 3, "no eval_on_other.json");
  ExpectDone(eval + " --data other");
  EXPECT_TRUE(Exists("r/eval_on_other.json") && Exists("r/eval_on_other.md"));
  EXPECT_EQ(ReadText(folder_ / "r/eval.json").value(), own);
  ExpectDone(eval + " --data other --compare r");
  // The run's own dataset, wherever it lies.
  std::filesystem::rename(folder_ / "d", folder_ / "moved");
  Write("r/eval.json", std::string("of an earlier call"));
  ExpectDone(eval + " --data moved");
  EXPECT_EQ(ReadText(folder_ / "r/eval.json").value(), own);
  ExpectDone(TrainTiny("moved", "r") + " --force");
  EXPECT_FALSE(Exists("r/eval_on_other.json"));  // of other weights
}

TEST_F(Outputs, PredictionsScoresAndReports) {
  MakeData(In("d"));
  MakeRun(In("d"), In("r"));
  ExpectDone("dataset-view --data d --split train --out p/x.png");
  const std::string predict = "predict --run r --refine 0 --out p ";
  Write("p/x_predicted.glb", "mine");
  ExpectKept("p/x_predicted.glb", predict + "p/x.png", "--force");
  EXPECT_FALSE(Exists("p/x_turntable.png"));
  ExpectDone(predict + "p/x.png --force");
  ExpectKept("p/x_turntable.webp", predict + "p/x.png", "--force");
  // A picture that is read here, and has the name of a result.
  std::filesystem::copy_file(folder_ / "p/x.png", folder_ / "p/y.png");
  std::filesystem::copy_file(folder_ / "p/x.png", folder_ / "p/y_turntable.png");
  ExpectKept("p/y_turntable.png", predict + "--force p/y.png p/y_turntable.png",
             "is an input of this command");
  for (const auto& [file, command] : {std::pair("r/eval.md", "eval --run r --views-per-model 1"),
                                      std::pair("r/report.html", "report --run r --models 1"),
                                      std::pair("r/summary.png", "report --run r --models 1")}) {
    Write(file, std::string("of an earlier call"));
    ExpectDone(command);
    EXPECT_NE(ReadText(folder_ / file).value(), "of an earlier call") << file;
  }
  for (const char* file : {"page.html", "page_summary.png"}) {
    const std::string report = "report --run r --models 1 --out page.html";
    Write(file, std::string("mine"));
    ExpectKept(file, report, "--force");
    ExpectDone(report + " --force");
  }
}

TEST_F(Outputs, PagesAndStudies) {
  Write("tradeoff/tradeoff.csv", "mine");
  ExpectKept("tradeoff/tradeoff.csv", "tradeoff fuze.obj --size 8 --repetitions 1", "--force");
  EXPECT_FALSE(Exists("tradeoff/tradeoff.md"));
}

// tilegrad info: what it says of instruction sets holds for the program.

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
  ExpectIn(said.output, "vertices: 4\n", "faces: 2\n", "extent: 2 x 1 x 3, from (10, 0, -3)",
           "materials: 2: \"wood\", \"steel\"\n", "4 x 2 pixels\n",
           "watertight: no: 4 edges of one face, 0 of more than two\n");
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
       {std::pair("torn.obj", &torn), {"open.obj", &open}, {"more.obj", &more}}) {
    Write(name, ObjText(*mesh, [](glm::vec3 p) { return p; }));
  }
  const auto all = Described(In("torn.obj") + " " + In("open.obj") + " " + In("more.obj"));
  EXPECT_EQ(all[0]["watertight"], true);
  EXPECT_EQ(all[1]["watertight"], false);
  EXPECT_EQ(all[1]["edges_of_one_face"], 3);
  EXPECT_EQ(all[2]["watertight"], false);
  EXPECT_EQ(all[2]["edges_of_more_than_two"], 3);
  ExpectRefused("info " + In("none.obj") + " " + In("torn.obj"), 3, "watertight: yes");
}

}  // namespace tilegrad::outputs_test

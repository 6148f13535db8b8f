// SPDX-License-Identifier: Apache-2.0
// Options of several words, wherever files stand among them; options that commands share.
#include <gtest/gtest.h>

#include "io/glb_writer.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::option_words_test {

class OptionWords : public ProgramTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
    ASSERT_TRUE(io::SaveGlb(folder_ / "b.glb", Box({0, 0, 0}, {1, 1, 1})).ok());
  }
  Bytes Picture(const std::string& arguments) const {
    ExpectDone("render --size 16 " + arguments + " --out " + In("p.png") + " --force");
    return ReadFile(folder_ / "p.png").value();
  }
};

// Each option last before one mesh, before two, and after them.
TEST_F(OptionWords, LeaveTheMeshesAlone) {
  const std::string meshes = In("a.glb") + " " + In("b.glb");
  for (const std::string option :
       {"--eye 0 -.5 4", "--eye 0,-.5,4", "--eye 0 0 4 --target 0 .5 -1e-3", "--light 1 -.5 0 1",
        "--light 1 0 0 1 --light 0 1 0 1", "--shading sh --sh 1 0 0 0 0 0 0 0 -.5",
        "--background 1 .5 0", "--eye 0 0 4 --up 0 0.1 1", "--outputs color depth",
        "--outputs color,depth --outputs faces"}) {
    const std::string rest = " --size 8 --out " + In("out");
    for (const std::string& line :
         {option + " " + meshes + rest, option + rest + " " + meshes, meshes + " " + option + rest,
          rest + " " + option + " " + meshes,
          In("a.glb") + " " + option + " " + In("b.glb") + rest}) {
      std::filesystem::remove_all(folder_ / "out");
      ExpectDone("render " + line);
      EXPECT_TRUE(Exists("out/a.png")) << line;
      EXPECT_TRUE(Exists("out/b.png")) << line;
    }
  }
}

// The numbers are those that were given, in either way of writing them.
TEST_F(OptionWords, AreTheNumbersThatWereGiven) {
  const std::string mesh = " " + In("b.glb");
  const Bytes picture = Picture("--eye 3 -.5 4 --background 0 .5 1" + mesh);
  EXPECT_EQ(Picture(mesh + " --eye 3,-.5,4 --background=0,.5,1"), picture);
  EXPECT_NE(Picture(mesh + " --eye 3,.5,4 --background=0,.5,1"), picture);
}

TEST_F(OptionWords, ThatAreTooFewAreSaidOfTheirOption) {
  const std::string mesh = In("a.glb");
  ExpectRefused("render " + mesh + " --eye 0 0", 2, "--eye");
  ExpectRefused("render --eye 0 0 " + mesh, 2, "--eye");
  ExpectRefused("render " + mesh + " --eye 0 0 --size 8", 2, "--eye: invalid value 0,0,--size");
  ExpectRefused("render --out " + In("out") + " " + mesh + " --eye 0 0 4 5", 3,
                "5: no such file");  // another mesh
  ExpectRefused("render " + mesh + " --eye 0 0 4 --eye 0 0 5", 2, "--eye: too many values");
  ExpectRefused("render " + mesh + " --light 1 0 0", 2, "--light");
  ExpectRefused("render " + mesh + " --sh 1 2 3", 2, "--sh");
  ExpectRefused("render " + mesh + " --background red", 2, "--background");
  ExpectRefused("render --eye 0 0 4", 2, "meshes");
}

TEST_F(OptionWords, MistypedNamesAreAnswered) {
  const std::string render = "render " + In("a.glb") + " ";
  for (const auto& [line, part] : std::vector<std::pair<std::string, std::string>>{
           {"rendr " + In("a.glb"), "did you mean render?"},
           {"Render " + In("a.glb"), "did you mean render?"},
           {"dataset_view", "did you mean dataset-view or dataset?"},
           {"--hlep", "did you mean --help?"},
           {"photo.png", "unknown command \"photo.png\"; see"},
           {render + "--output x.png",
            "unknown option --output (did you mean --outputs or --out?)"},
           {render + "--colour red", "tilegrad: render: unknown option --colour; see"},
           {"dataset procedural", "unexpected argument \"procedural\""},
           {"timelapse f --seconds 0", "0 must be a number above 0"},
           {"dataset-view --data d --view -1", "-1 must be a number, 0 or above"},
           {"report --out page.pdf", "page.pdf: the file must end in .html"},
           {render + "--backgroud 1 1 1", "did you mean --background?"},
           {render + "--fvo=30", "did you mean --fov?"},
           {render + "--shading fancy", "fancy is not one of lambert,none,phong,sh"},
           {"views " + In("a.glb") + " --up w --out " + In("v"), "w is not one of x,y,z"},
           {render + "--size", "render: --size needs a value; see tilegrad render --help"},
           {render + "--force=1", "render: --force takes no value"},
           {render + "--eye 0,0,x", "render: --eye: invalid value 0,0,x"},
           {render + "--supersample 99", "--supersample: 99 is not in 1 to 16"},
           {"fit f --steps 1 --steps 2", "fit: --steps was given 2 times"},
           {"fit f --steps 1 --quality fast", "--steps and --quality exclude each other"},
           {"fit f --quality good", "--quality: good is not one of fast,normal,best"},
           {"", "no command given; see tilegrad --help"}}) {
    ExpectRefused(line, 2, part);
  }
  for (const std::string& line : {std::string("info"), render}) {
    const Outcome outcome = RunProgram(line, "TILEGRAD_THREADS=many ");
    EXPECT_EQ(outcome.exit_code, 2);
    ExpectIn(outcome.output, "TILEGRAD_THREADS: \"many\" must be");
  }
  ExpectRefused("help", 0, "Usage: tilegrad");
  ExpectRefused("version", 0, ".");
  ExpectRefused(render + "--size 8 --shading PHONG --out " + In("p.png"), 0, "wrote");
}

TEST_F(OptionWords, OfOtherCommandsLeaveTheirFilesAlone) {
  ExpectDone("tradeoff --size 8 --repetitions 1 --out " + In("t") +
             " --deltas 1e-2 --errors 0 1e-3 " + In("b.glb"));
  const std::string csv = ReadText(folder_ / "t/tradeoff.csv").value();
  ExpectIn(csv, "\nb,12,");
  const std::string fit =
      "fit --out " + In("f") + " --lighting lambert --optimize positions,light ";
  for (const std::string option : {"--light-direction 0 -1 .5 ", "--rate positions=1 light=2 ",
                                   "--rate positions=1,light=2 ", "--light-direction=0,0,1 "}) {
    ExpectRefused(fit + option + In("none"), 3, In("none"));
  }
}

TEST_F(OptionWords, TheLimitOfMemoryIsAnOptionOfEveryReader) {
  ImageU8 image(512, 512, 3);
  ASSERT_TRUE(io::SavePng(folder_ / "t.png", image).ok());
  Write("t.mtl", "newmtl m\nmap_Kd t.png\n");
  Write("t.obj",
        "mtllib t.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"
        "f 1/1 2/1 3/1\n");
  const std::string render = "render " + In("t.obj") + " --size 8 --force --out " + In("p.png");
  ExpectRefused(render + " --read-limit 500K", 1, "--read-limit");
  ExpectDone(render + " --read-limit 20M");
  ExpectDone(render + " --read-limit 20M", "TILEGRAD_READ_LIMIT=1K ");
  EXPECT_EQ(RunProgram(render, "TILEGRAD_READ_LIMIT=1K ").exit_code, 1);
  ExpectRefused(render + " --read-limit much", 2, "is not a size");
  ExpectIn(RunProgram(render, "TILEGRAD_READ_LIMIT=much ").output, "is not a size");
  for (const char* command : {"dataset", "dataset-view", "eval", "fit", "predict", "render",
                              "report", "tradeoff", "train", "views"}) {
    ExpectRefused(std::string(command) + " --help", 0, "--read-limit");
  }
  for (const std::string& line :
       {"views " + In("t.obj") + " --views 1 --size 8 --out " + In("v"),
        "tradeoff " + In("t.obj") + " --size 8 --repetitions 1 --out " + In("s"),
        "predict --run " + In("none") + " " + In("t.png")}) {
    const Outcome outcome = RunProgram(line + " --read-limit 1K");
    EXPECT_GT(outcome.exit_code, 0) << line << outcome.output;
  }
}

}  // namespace tilegrad::option_words_test

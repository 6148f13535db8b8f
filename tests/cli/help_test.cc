// SPDX-License-Identifier: Apache-2.0
// What the program says of itself: help, manual pages, completions, configurations; and what it
// says when it is to be quiet, or read by programs.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "base/file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::help_test {

using Json = nlohmann::json;

class Help : public ProgramTest {};

// The commands, as --help lists them.
std::vector<std::string> Commands(const std::string& help) {
  std::istringstream text(help);
  std::vector<std::string> names;
  bool begun = false;
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with("Subcommands:")) begun = true;
    if (begun && line.size() > 2 && line.starts_with("  ") && line[2] != ' ')
      names.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return names;
}

bool Has(const char* program) {
  return std::system((std::string("command -v ") + program + " >/dev/null").c_str()) == 0;
}

TEST_F(Help, IsTheSameEitherWayRound) {
  EXPECT_EQ(ExpectDone("help fit"), ExpectDone("fit --help"));
  EXPECT_EQ(ExpectDone("help"), ExpectDone("--help"));
  ExpectRefused("help trian", 2, "did you mean train?");
}

// As of `help fit | head`.
TEST_F(Help, AReaderThatHasSeenEnoughIsNoError) {
  for (const char* asked : {"help fit", "man fit"}) {
    const Outcome outcome =
        RunProgram(std::string(asked) + " 2>" + In("said") + ") | true;", "(sleep 0.2; ");
    EXPECT_EQ(ReadText(folder_ / "said").value(), "") << outcome.output;
  }
}

TEST_F(Help, PagesAndCompletionsHaveEveryCommand) {
  const std::vector<std::string> commands = Commands(ExpectDone("--help"));
  ASSERT_GT(commands.size(), 12u);
  ExpectDone("man --out " + In("man"));
  for (const std::string& name : commands) {
    const auto page = ReadText(folder_ / "man" / ("tilegrad-" + name + ".1"));
    ASSERT_TRUE(page.ok()) << name;
    EXPECT_EQ(page->find(".TH tilegrad\\-"), 0u) << name;
    EXPECT_EQ(ExpectDone("man " + name), *page);
    for (const char* shell : {"bash", "zsh", "fish"})
      ExpectIn(ExpectDone(std::string("completion ") + shell), name);
  }
  ExpectIn(ExpectDone("man fit"), "\\fB\\-\\-threads\\fR");
  if (!Has("mandoc")) GTEST_SKIP() << "mandoc is not installed";
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "man")) {
    const std::string check = "mandoc -T lint -W error " + entry.path().string() + " >&2";
    EXPECT_EQ(std::system(check.c_str()), 0) << entry.path();
  }
}

TEST_F(Help, BashCompletes) {
  ASSERT_TRUE(WriteTextAtomic(folder_ / "complete", ExpectDone("completion bash")).ok());
  const auto completed = [&](const std::string& line) {
    const std::string script =
        "source " + In("complete") + "; cd " + folder_.string() + "; COMP_WORDS=(" + line +
        "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _tilegrad; echo \"${COMPREPLY[*]}\"";
    std::FILE* pipe = ::popen(("bash -c '" + script + "'").c_str(), "r");
    std::string out(256, '\0');
    out.resize(std::fread(out.data(), 1, out.size(), pipe));
    ::pclose(pipe);
    return out;
  };
  EXPECT_EQ(completed("tilegrad tra"), "tradeoff train\n");
  EXPECT_EQ(completed("tilegrad fit --lig"), "--lighting --light-direction\n");
  EXPECT_EQ(completed("tilegrad fit --lighting p"), "phong\n");
  EXPECT_EQ(completed("tilegrad train --config qu"), "quick\n");
  EXPECT_EQ(completed("tilegrad fit --mesh comp"), "complete\n");
  EXPECT_EQ(completed("tilegrad help sel"), "selftest\n");
}

TEST_F(Help, OtherShellsReadTheirScripts) {
  int shells = 0;
  for (const char* shell : {"zsh", "fish"}) {
    if (!Has(shell)) continue;
    ++shells;
    Ok(WriteTextAtomic(folder_ / shell, ExpectDone(std::string("completion ") + shell)));
    EXPECT_EQ(std::system((std::string(shell) + " -n " + In(shell)).c_str()), 0) << shell;
  }
  if (shells == 0) GTEST_SKIP() << "neither zsh nor fish is installed";
}

TEST_F(Help, ConfigurationsAreKnownByNameAnywhere) {
  const std::string in_folder = "cd " + folder_.string() + " && ";
  const std::string quick = ExpectDone("configs quick", in_folder);
  EXPECT_EQ(quick, ReadText(Path(TILEGRAD_CONFIGS) / "quick.toml").value());
  ExpectIn(ExpectDone("configs"), "paper");
  ExpectRefused(RunProgram("train --config qick --data x --out y", in_folder), 3,
                "there are best, ");
  // It gets as far as the dataset.
  const Outcome named = RunProgram("train --config quick --data none --out y", in_folder);
  ExpectIn(named.output, "none");
  ExpectNotIn(named.output, "quick");
}

TEST_F(Help, JsonIsOneObjectAndQuietSaysNothing) {
  ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
  const std::string render = "render --size 16 --force " + In("a.glb") + " --out " + In("p.png");
  EXPECT_EQ(ExpectDone(render + " --quiet"), "");
  const auto files = Json::parse(ExpectDone(render + " --json"))["files"];
  ASSERT_EQ(files.size(), 1u);
  EXPECT_EQ(files[0], In("p.png"));
  const auto views = Json::parse(ExpectDone("views " + In("a.glb") + " --views 3 --size 16 --out " +
                                            In("views") + " --json --quiet"));
  EXPECT_EQ(views["views"], 3);
  // Quiet: from a second on a command says on the other stream how far it is.
  const auto fit = Json::parse(ExpectDone("fit " + In("views") + " --steps 2 --template-level 1" +
                                          " --out " + In("fit") + " --json --quiet"));
  EXPECT_EQ(fit["steps"], 2);
  EXPECT_TRUE(std::filesystem::exists(fit["mesh"].get<std::string>()));
  EXPECT_EQ(Json::parse(ExpectDone("info --json"))["target"].is_string(), true);
  // Errors stay sentences on the other stream.
  ExpectRefused("render --json " + In("none.glb"), 3, "none.glb");
}

// Options of several words, wherever files stand among them; options that commands share.

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
    ExpectRefused(RunProgram(line, "TILEGRAD_THREADS=many "), 2,
                  "TILEGRAD_THREADS: \"many\" must be");
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

}  // namespace tilegrad::help_test

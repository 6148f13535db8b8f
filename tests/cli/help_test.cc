// SPDX-License-Identifier: Apache-2.0
// What the program says of itself: help, manual pages, completions, configurations; and what it
// says when it is to be quiet, or read by programs.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "base/file.h"
#include "io/glb_writer.h"
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
    ASSERT_TRUE(
        WriteTextAtomic(folder_ / shell, ExpectDone(std::string("completion ") + shell)).ok());
    EXPECT_EQ(std::system((std::string(shell) + " -n " + In(shell)).c_str()), 0) << shell;
  }
  if (shells == 0) GTEST_SKIP() << "neither zsh nor fish is installed";
}

TEST_F(Help, ConfigurationsAreKnownByNameAnywhere) {
  const std::string in_folder = "cd " + folder_.string() + " && ";
  const std::string quick = ExpectDone("configs quick", in_folder);
  EXPECT_EQ(quick, ReadText(Path(TILEGRAD_CONFIGS) / "quick.toml").value());
  ExpectIn(ExpectDone("configs"), "paper");
  const Outcome wrong = RunProgram("train --config qick --data x --out y", in_folder);
  EXPECT_EQ(wrong.exit_code, 3);
  ExpectIn(wrong.output, "there are best, ");
  // It gets as far as the dataset.
  const Outcome named = RunProgram("train --config quick --data none --out y", in_folder);
  ExpectIn(named.output, "none");
  EXPECT_EQ(named.output.find("quick"), std::string::npos) << named.output;
}

TEST_F(Help, JsonIsOneObjectAndQuietSaysNothing) {
  ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Icosphere(1, 1)).ok());
  const std::string render = "render --size 16 --force " + In("a.glb") + " --out " + In("p.png");
  EXPECT_EQ(ExpectDone(render + " --quiet"), "");
  const auto files = Json::parse(ExpectDone(render + " --json"))["files"];
  ASSERT_EQ(files.size(), 1u);
  EXPECT_EQ(files[0], In("p.png"));
  const auto views = Json::parse(
      ExpectDone("views " + In("a.glb") + " --views 3 --size 16 --out " + In("views") + " --json"));
  EXPECT_EQ(views["views"], 3);
  // Quiet: from a second on it says on the other stream how far it is.
  const auto fit = Json::parse(ExpectDone("fit " + In("views") + " --steps 2 --template-level 1" +
                                          " --out " + In("fit") + " --json --quiet"));
  EXPECT_EQ(fit["steps"], 2);
  EXPECT_TRUE(std::filesystem::exists(fit["mesh"].get<std::string>()));
  EXPECT_EQ(Json::parse(ExpectDone("info --json"))["target"].is_string(), true);
  // Errors stay sentences on the other stream.
  const Outcome wrong = RunProgram("render --json " + In("none.glb"), "");
  EXPECT_EQ(wrong.exit_code, 3);
  ExpectIn(wrong.output, "none.glb");
}

}  // namespace tilegrad::help_test

// SPDX-License-Identifier: Apache-2.0
// Names of files and classes that try to be more than names, and what killed commands leave.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "io/glb_writer.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::hostile_names_test {

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

}  // namespace tilegrad::hostile_names_test

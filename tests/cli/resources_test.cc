// SPDX-License-Identifier: Apache-2.0
// The program with too few file handles, threads or too little memory, and stopped by signals:
// models are as sound as they were.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "base/sanitizers.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/process.h"
#include "support/run_program.h"
#include "support/terminal.h"

namespace tilegrad::resources_test {

class Resources : public ProgramTest {
 protected:
  // Three models with side files, of readers in this process and in one of their own.
  void WriteModels() {
    ImageU8 image(8, 8, 3);
    for (const char* name : {"a", "b", "c"}) {
      const std::string stem = std::string("in/thing/") + name;
      Write(stem + ".obj", "mtllib " + std::string(name) +
                               ".mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\n"
                               "f 1/1 2/1 3/1\nf 1/1 3/1 4/1\nf 1/1 4/1 2/1\n");
      Write(stem + ".mtl", "newmtl m\nKd 1 0 0\nmap_Kd " + std::string(name) + ".png\n");
      ASSERT_TRUE(io::SavePng(folder_ / (stem + ".png"), image).ok());
    }
    ASSERT_TRUE(io::SaveGlb(folder_ / "in/thing/d.glb", Icosphere(0, 1)).ok());
  }

  // Makes the dataset under `limit`, a command of the shell. What was made has all models and no
  // warning; else a sentence names what is lacking, and the same command without the limit goes on.
  // Returns whether it was made.
  bool Make(const std::string& limit) {
    const Path out = folder_ / "out";
    const std::string arguments =
        "dataset --source folder --workers 2 --size 16 --views 2 --input " + In("in") + " --out " +
        out.string();
    const Outcome outcome = RunProgram(arguments, limit + "; exec ");
    SCOPED_TRACE(limit);
    if (outcome.exit_code == 0) {
      ExpectIn(outcome.output, "4 models");
      ExpectNotIn(outcome.output, "could not be used", "while reading models");
    } else {
      EXPECT_GT(outcome.exit_code, 0) << "a signal: " << outcome.output;
      const auto rejected = ReadText(out / "rejected.jsonl");
      EXPECT_TRUE(!rejected.ok() || rejected->empty()) << *rejected;
      ExpectNotIn(outcome.output, "damaged");
      EXPECT_EQ(RunProgram(arguments).exit_code, 0);
    }
    std::filesystem::remove_all(out);
    return outcome.exit_code == 0;
  }
};

TEST_F(Resources, FewFileHandlesAreNoDamage) {
  WriteModels();
  int made = 0, refused = 0;
  for (int handles = 4; handles <= 20; ++handles) {
    (Make("ulimit -n " + std::to_string(handles)) ? made : refused) += 1;
  }
  EXPECT_GT(made, 0);
  EXPECT_GT(refused, 0);
}

TEST_F(Resources, LittleMemoryIsNoDamage) {
  if (kSanitizer) GTEST_SKIP() << "sanitizers reserve terabytes";
  WriteModels();
  for (int megabytes = 200; megabytes <= 600; megabytes += 50) {
    (void)Make("ulimit -v " + std::to_string(megabytes << 10));
  }
  EXPECT_TRUE(Make("ulimit -v " + std::to_string(4 << 20)));
}

// A mesh whose reader takes seconds.
class Signals : public ProgramTest {
 protected:
  static std::size_t ResidentBytes(pid_t process) {
    std::ifstream file("/proc/" + std::to_string(process) + "/statm");
    std::size_t all = 0, resident = 0;
    file >> all >> resident;
    return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  }

  static bool Catches(pid_t process, int signal) {
    std::ifstream file("/proc/" + std::to_string(process) + "/status");
    std::uint64_t caught = 0;
    for (std::string word; file >> word;) {
      if (word == "SigCgt:") file >> std::hex >> caught;
    }
    return (caught >> (signal - 1) & 1) != 0;
  }

  // The program's exit code after `signal`, sent once its reader works, and how long it took then.
  std::pair<int, double> Stop(int signal) {
    std::string stl = "solid x\n";
    for (int i = 0; i < 400'000; ++i) {
      stl += "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 " + std::to_string(i) +
             "\nvertex 0 1 0\nendloop\nendfacet\n";
    }
    const std::string file = Write("large.stl", stl + "endsolid x\n").string();
    const std::size_t bytes = stl.size();
    std::string().swap(stl);  // a child has its parent's memory at first
    const pid_t child =
        StartProcess({TILEGRAD_PROGRAM, "render", file, "--out", In("out.png"), "--size", "4096"},
                     folder_ / "said.txt");
    // Until it has the file. Sanitizers' own memory is large from the start on.
    while (ResidentBytes(child) < bytes || !Catches(child, signal)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (::waitpid(child, nullptr, WNOHANG) == child) return {-1, 0};
    }
    const auto start = std::chrono::steady_clock::now();
    ::kill(child, signal);
    const int code = EndProcess(child);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    return {code, seconds.count()};
  }
};

TEST_F(Signals, StopAReaderAtOnceWithTheirOwnCode) {
  for (const auto& [signal, code] : {std::pair(SIGINT, 130), std::pair(SIGTERM, 143)}) {
    const auto [got, seconds] = Stop(signal);
    EXPECT_EQ(got, code);
    EXPECT_LT(seconds, 2);
  }
}

// With support/few_threads.c as the system.
class FewThreads : public ProgramTest {
 protected:
  void SetUp() override {
    if (kSanitizer) GTEST_SKIP() << "LD_PRELOAD comes before the sanitizer";
    Write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n");
  }
  void TearDown() override { unsetenv("LD_PRELOAD"); }

  Outcome RunWith(int granted, const std::string& arguments) {
    setenv("TILEGRAD_TEST_THREADS", std::to_string(granted).c_str(), 1);
    setenv("LD_PRELOAD", TILEGRAD_FEW_THREADS, 1);
    const Outcome outcome = RunProgram(arguments);
    unsetenv("LD_PRELOAD");
    return outcome;
  }
  // `command` with --workers 4 and no, one, two, all of the three threads: what it prints or, if it
  // is named, the file that it writes is the same.
  void ExpectSame(const std::string& command, const std::string& file = "") {
    std::string all;
    for (const int granted : {100, 0, 1, 2}) {
      if (!file.empty())
        std::filesystem::remove_all(folder_ / *std::filesystem::path(file).begin());
      const Outcome outcome = RunWith(granted, command + " --workers 4");
      EXPECT_EQ(outcome.exit_code, 0) << granted << ": " << outcome.output;
      const std::string warning = "warning: the system allows fewer threads";
      const auto at = outcome.output.find(warning);
      EXPECT_EQ(at != std::string::npos, granted < 3) << granted << ": " << outcome.output;
      EXPECT_EQ(outcome.output.rfind(warning), at) << "twice: " << outcome.output;
      const std::string got = file.empty() ? "" : ReadText(folder_ / file).value();
      if (granted == 100) all = got;
      EXPECT_EQ(got, all) << granted;
    }
  }
};

TEST_F(FewThreads, MakeTheSameFiles) {
  ExpectSame("render " + In("a.obj") + " --size 256 --out " + In("a.png"), "a.png");
  ExpectSame("dataset --source procedural --per-class 1 --size 16 --views 2 --out " + In("data"),
             "data/dataset.json");
  ExpectSame("selftest --only 'same bits'");  // which makes workers of up to 7 itself
}

// What a person sees of work that goes on, and how soon it ends at Ctrl-C.

// A machine that does other work, too, takes its time.
constexpr double kSoon = 2;

class TerminalTest : public ProgramTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(io::SaveGlb(folder_ / "a.glb", Box({0, 0, 0}, {1, 0.6f, 0.8f})).ok());
    ExpectDone("views " + In("a.glb") + " --views 8 --size 64 --out " + In("v"));
  }
};

std::size_t Longest(const std::vector<std::string>& lines, const std::string& begin) {
  std::size_t longest = 0;
  for (const std::string& line : lines) {
    if (line.starts_with(begin)) longest = std::max(longest, line.size());
  }
  return longest;
}

TEST_F(TerminalTest, ProgressIsCutToItsWidth) {
  TerminalProgram wide("fit " + In("v") + " --steps 60 --stop-gain 0 --out " + In("wide"), 200);
  EXPECT_EQ(wide.Finish(), 0) << wide.said();
  EXPECT_GT(Longest(wide.Lines(), "fitting"), 79u);  // else there would be nothing to cut
  TerminalProgram narrow("fit " + In("v") + " --steps 60 --stop-gain 0 --out " + In("narrow"), 80);
  EXPECT_EQ(narrow.Finish(), 0) << narrow.said();
  EXPECT_EQ(Longest(narrow.Lines(), "fitting"), 79u);
}

TEST_F(TerminalTest, ProgressFollowsItsWidth) {
  TerminalProgram fit("fit " + In("v") + " --steps 3000 --stop-gain 0 --out " + In("f"), 120);
  ASSERT_TRUE(fit.AwaitText("images/s")) << fit.said();
  fit.Resize(50);
  const std::size_t told = fit.said().size();
  for (int redraw = 0; redraw < 4; ++redraw)
    ASSERT_TRUE(fit.AwaitText("fitting", fit.said().size())) << fit.said();
  EXPECT_EQ(fit.Interrupt() < kSoon, true) << fit.said();
  const std::vector<std::string> lines = fit.Lines(told);
  // The first may have been drawn before.
  EXPECT_LE(Longest({lines.begin() + 2, lines.end()}, "fitting"), 49u);
  EXPECT_GT(Longest(lines, "fitting"), 20u);
}

TEST_F(TerminalTest, EveryStageOfAFitIsTold) {
  TerminalProgram fit("fit " + In("v") + " --steps 20 --out " + In("f"), 80);
  EXPECT_EQ(fit.Finish(), 0);
  for (const char* stage :
       {"reading images", "carving the visual hull", "simplifying the visual hull",
        "placing the texture", "checking gradients", "fitting", "filling the texture",
        "scoring views"}) {
    EXPECT_GT(Longest(fit.Lines(), stage), 0u) << stage << "\n" << fit.said();
  }
  // Short ones leave nothing behind, and where there is no terminal say nothing.
  const Outcome logged = RunProgram("fit " + In("v") + " --steps 20 --out " + In("g"));
  ExpectNotIn(logged.output, "reading images");
}

// Before there is anything to save, in the search for cameras, and while it fits.
TEST_F(TerminalTest, CtrlCEndsAFitSoonAndSaysHowItGoesOn) {
  for (const std::string option : {" --find-cameras", ""}) {
    const std::string out = In("f" + std::to_string(option.size()));
    TerminalProgram fit("fit " + In("v") + option + " --steps 100000 --stop-gain 0 --out " + out,
                        200);
    ASSERT_TRUE(fit.AwaitText(option.empty() ? "fitting" : "looking for cameras")) << fit.said();
    EXPECT_LT(fit.Interrupt(), kSoon);
    EXPECT_EQ(fit.Finish(), 130);
    ExpectIn(fit.said(), "resume with: tilegrad fit --resume --out " + out);
  }
  TerminalProgram again("fit --resume --out " + In("f0"), 200);
  ASSERT_TRUE(again.AwaitText("fitting")) << again.said();
  EXPECT_LT(again.Interrupt(), kSoon);
}

}  // namespace tilegrad::resources_test

// SPDX-License-Identifier: Apache-2.0
// The program where the system refuses threads: the same files, a warning, no crash.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/sanitizers.h"
#include "support/run_program.h"

namespace tilegrad::few_threads_test {

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
      const std::string warning = "warning: the system refuses as many threads";
      const auto at = outcome.output.find(warning);
      EXPECT_EQ(at != std::string::npos, granted < 3) << granted << ": " << outcome.output;
      EXPECT_EQ(outcome.output.rfind(warning), at) << "twice: " << outcome.output;
      const std::string got = file.empty() ? "" : ReadText(folder_ / file).value();
      if (granted == 100) all = got;
      EXPECT_EQ(got, all) << granted;
    }
  }
};

TEST_F(FewThreads, Render) {
  ExpectSame("render " + In("a.obj") + " --size 256 --out " + In("a.png"), "a.png");
}

TEST_F(FewThreads, MakeADataset) {
  ExpectSame("dataset --source procedural --per-class 1 --size 16 --views 2 --out " + In("data"),
             "data/dataset.json");
}

// Which makes workers of up to 7 itself.
TEST_F(FewThreads, PassTheSelfTest) { ExpectSame("selftest --only 'same bits'"); }

}  // namespace tilegrad::few_threads_test

// SPDX-License-Identifier: Apache-2.0
// What a person sees of work that goes on, and how soon it ends at Ctrl-C.
#include "support/terminal.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "io/glb_writer.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::terminal_test {

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
  EXPECT_EQ(logged.output.find("reading images"), std::string::npos) << logged.output;
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

}  // namespace tilegrad::terminal_test

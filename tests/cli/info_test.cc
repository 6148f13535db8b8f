// SPDX-License-Identifier: Apache-2.0
// tilegrad info: what it says of instruction sets holds for the program.
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>

#include "base/simd_target.h"
#include "support/run_program.h"

namespace tilegrad::info_test {

std::string Info() {
  const Outcome outcome = RunProgram("info");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  return outcome.output;
}

// The rest of the line behind `start`.
std::string LineBehind(const std::string& text, const std::string& start) {
  const std::size_t from = text.find(start);
  EXPECT_NE(from, std::string::npos) << start << " is not in: " << text;
  if (from == std::string::npos) return "";
  return text.substr(from + start.size(), text.find('\n', from) - from - start.size());
}

TEST(InfoCommand, TakesTheBestTargetUnlessOneIsForced) {
  ::unsetenv("TILEGRAD_TARGET");
  std::istringstream targets(LineBehind(Info(), "best first: "));
  std::string best;
  targets >> best;
  std::string target = best;
  EXPECT_EQ(LineBehind(Info(), "in use: ").rfind(best + " (the best", 0), 0u) << Info();
  while (targets >> target) {
    ::setenv("TILEGRAD_TARGET", target.c_str(), 1);
    EXPECT_EQ(LineBehind(Info(), "in use: "), target + " (forced by TILEGRAD_TARGET)");
  }
  EXPECT_EQ(target, RunnableTargets().back());
  ::unsetenv("TILEGRAD_TARGET");
}

}  // namespace tilegrad::info_test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "support/temp_folder.h"

namespace tilegrad::test::prove_test {

class ProveTest : public TempFolderTest {
 protected:
  // The exit code, or -1.
  int Prove() const {
    const std::string command = std::string(TILEGRAD_PROVE) + " --seconds 0.001 --state " +
                                state_.string() + " > " + output_.string() + " 2>&1";
    const int status = std::system(command.c_str());
    return status % 256 == 0 ? status / 256 : -1;
  }
  std::string Output() const { return ReadText(output_).value(); }
  // The last row that it prints, and the scene that the file goes on with.
  struct Sums {
    unsigned long long next = 0, scenes = 0, numbers = 0, violations = 0;
    double ratio = 0;
  };
  Sums Sum() const {
    Sums s;
    const std::string kept = ReadText(state_).value(), said = Output();
    EXPECT_EQ(std::sscanf(kept.c_str(), "tilegrad prove 1 next %llu", &s.next), 1) << kept;
    EXPECT_EQ(
        std::sscanf(said.substr(said.find("| all |")).c_str(), "| all | | %llu | %llu | %llu | %lf",
                    &s.scenes, &s.numbers, &s.violations, &s.ratio),
        4)
        << said;
    return s;
  }

  const Path state_ = folder_ / "tally.txt", output_ = folder_ / "output";
};

TEST_F(ProveTest, CountsAndGoesOn) {
  ASSERT_EQ(Prove(), 0) << Output();
  const Sums first = Sum();
  EXPECT_GT(first.next, 0u);
  EXPECT_EQ(first.scenes, first.next);
  EXPECT_EQ(first.violations, 0u);
  EXPECT_GT(first.numbers, first.next);
  EXPECT_GT(first.ratio, 0);
  EXPECT_LE(first.ratio, 1);
  ASSERT_EQ(Prove(), 0) << Output();
  EXPECT_EQ(Sum().next, 2 * first.next);
  EXPECT_EQ(Sum().scenes, 2 * first.next);
}

TEST_F(ProveTest, AViolationIsKeptAndNamed) {
  const std::string violation = "scene 7 on EMU128: beyond E";
  Write("tally.txt",
        "tilegrad prove 1\nnext 500\nalpha x 500 9000 1 1.25 2\nviolation " + violation + "\n");
  EXPECT_EQ(Prove(), 1);
  ExpectIn(Output(), "VIOLATION " + violation);
  ExpectIn(ReadText(state_).value(), "\nviolation " + violation + "\n");
  EXPECT_EQ(Sum().violations, 1u);
  EXPECT_EQ(Sum().ratio, 1.25);
}

TEST_F(ProveTest, AFileThatIsNoTallyIsRefusedAndKept) {
  for (const char* text :
       {"", "hello\n", "tilegrad prove 1\nnext x\n", "tilegrad prove 1\na b 1\n"}) {
    Write("tally.txt", std::string(text));
    EXPECT_EQ(Prove(), 1) << text;
    ExpectIn(Output(), "tally.txt");
    EXPECT_EQ(*ReadText(state_), text);
  }
}

}  // namespace tilegrad::test::prove_test

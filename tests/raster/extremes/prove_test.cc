// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "raster/extremes/prove_tally.h"
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
  std::string Output() const {
    const auto text = ReadText(output_);
    return text.ok() ? *text : text.status().message();
  }
  ProofTally Tally() const { return Ok(ReadTally(state_)).value(); }

  const Path state_ = folder_ / "tally.txt", output_ = folder_ / "output";
};

TEST_F(ProveTest, CountsAndGoesOn) {
  ASSERT_EQ(Prove(), 0) << Output();
  const ProofTally first = Tally();
  EXPECT_GT(first.next, 0u);
  EXPECT_EQ(first.Sum().scenes, first.next);
  EXPECT_EQ(first.Sum().violations, 0u);
  EXPECT_GT(first.Sum().numbers, first.next);
  EXPECT_GT(first.Sum().ratio, 0);
  EXPECT_LE(first.Sum().ratio, 1);
  ASSERT_EQ(Prove(), 0) << Output();
  EXPECT_EQ(Tally().next, 2 * first.next);
  EXPECT_EQ(Tally().Sum().scenes, 2 * first.next);
}

TEST_F(ProveTest, AViolationIsKeptAndNamed) {
  ProofTally tally;
  tally.next = 500;
  tally.rows[{"alpha", "x"}] = {500, 9000, 1, 1.25, 2};
  tally.violations = {"scene 7 on EMU128: beyond E"};
  ASSERT_TRUE(WriteTally(state_, tally).ok());
  EXPECT_EQ(Prove(), 1);
  ExpectIn(Output(), "VIOLATION scene 7 on EMU128: beyond E");
  EXPECT_EQ(Tally().violations.size(), 1u);
  EXPECT_EQ(Tally().Sum().violations, 1u);
  EXPECT_EQ(Tally().Sum().ratio, 1.25);
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

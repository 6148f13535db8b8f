// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <gtest/gtest.h>

#include "base/did_you_mean.h"

namespace tilegrad::text_test {

TEST(Words, OneIsOne) {
  EXPECT_EQ(Count(1, "image"), "1 image");
  EXPECT_EQ(Count(0, "image"), "0 images");
  EXPECT_EQ(Count(std::uint64_t{2}, "class"), "2 classes");
  EXPECT_EQ(Count(std::int64_t{1}, "class"), "1 class");
}

TEST(Words, AreSuggestedWhereTheyAreNear) {
  EXPECT_TRUE(IsNear("stepz", "steps"));
  EXPECT_TRUE(IsNear("schedule.step", "schedule.steps"));
  EXPECT_FALSE(IsNear("optimizer.lr", "softras.far"));
  EXPECT_FALSE(IsNear("lr", "far"));
  EXPECT_EQ(DidYouMean("--outp", {"--outputs", "--out", "--view"}),
            " (did you mean --out or --outputs?)");
  EXPECT_EQ(DidYouMean("--color", {"--view"}), "");
}

TEST(Text, PercentIsDecodedAndPlusIsNoSpace) {
  EXPECT_EQ(DecodePercent("my%20wood+red%2Bblue.png"), "my wood+red+blue.png");
  EXPECT_EQ(DecodePercent("50%25.png"), "50%.png");
  EXPECT_EQ(DecodePercent("%c3%A9"), "\xc3\xa9");
  EXPECT_EQ(DecodePercent("%2525"), "%25");  // once
  EXPECT_EQ(DecodePercent(std::string_view("a%00b")), std::string("a\0b", 3));
}

TEST(Text, PercentWithoutTwoDigitsStaysAsItIs) {
  for (const char* text : {"", "%", "100%", "%4", "%zz", "%-1", "%+1", "% 1", "%0x41"})
    EXPECT_EQ(DecodePercent(text), text);
}

}  // namespace tilegrad::text_test

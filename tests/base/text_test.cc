// SPDX-License-Identifier: Apache-2.0
// Words for people.
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

}  // namespace tilegrad::text_test

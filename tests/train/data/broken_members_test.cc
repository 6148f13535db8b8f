// SPDX-License-Identifier: Apache-2.0
#include "train/data/broken_members.h"

#include <gtest/gtest.h>

#include "support/expect.h"

namespace tilegrad::train::broken_members_test {

TEST(BrokenMembers, OneInAHundredCostsItselfAlone) {
  BrokenMembers broken;
  EXPECT_TRUE(broken.Check(0, false).ok());
  EXPECT_EQ(broken.Summary(), "");
  broken.Add("chair/a", "no faces");
  EXPECT_TRUE(broken.Check(100, false).ok());
  ExpectMessage(broken.Check(99, false), "1 of 99", "--allow-broken", "chair/a: no faces");
  EXPECT_TRUE(broken.Check(1, true).ok());
}

TEST(BrokenMembers, EachReasonIsCountedWithItsFirst) {
  BrokenMembers broken;
  for (char name = 'a'; name <= 'k'; ++name) broken.Add(std::string(1, name), "x.png: cut");
  broken.Add("z", "no faces");
  ExpectIn(broken.Summary(), "11  cut (a, b, c, d, e, ...)", "1  no faces (z)");
}

}  // namespace tilegrad::train::broken_members_test

// SPDX-License-Identifier: Apache-2.0
// float16 against all of its 65,536 values, and against the numbers between them.
#include "base/half.h"

#include <gtest/gtest.h>

#include <limits>

namespace tilegrad::half_test {

TEST(Half, KnownValues) {
  EXPECT_EQ(FromHalf(0x3c00), 1.0f);
  EXPECT_EQ(FromHalf(0xc000), -2.0f);
  EXPECT_EQ(FromHalf(0x7bff), kLargestHalf);
  EXPECT_EQ(FromHalf(0x0001), 0x1p-24f);
  EXPECT_EQ(FromHalf(0x03ff), 1023 * 0x1p-24f);
  EXPECT_EQ(FromHalf(0x3555), 0.333251953125f);
  EXPECT_EQ(ToHalf(1.0f / 3), 0x3555);
  EXPECT_EQ(ToHalf(0x1p-25f), 0);       // a tie with zero, which is even
  EXPECT_EQ(ToHalf(0x1.8p-24f), 2);     // a tie of one step and two
  EXPECT_EQ(ToHalf(65519.0f), 0x7bff);  // nearer to the largest
  EXPECT_EQ(ToHalf(65520.0f), 0x7c00);  // a tie with what would be even
  EXPECT_EQ(ToHalf(-1e30f), 0xfc00);
  EXPECT_EQ(ToHalf(-0.0f), 0x8000);
  EXPECT_EQ(ToHalf(std::numeric_limits<float>::infinity()), kHalfInfinity);
}

TEST(Half, EachComesBack) {
  for (std::uint32_t half = 0; half < 65536; ++half) {
    const float value = FromHalf(static_cast<std::uint16_t>(half));
    const std::uint16_t back = ToHalf(value);
    if ((half & 0x7fff) > kHalfInfinity) {
      EXPECT_TRUE(std::isnan(value)) << half;
      EXPECT_TRUE(std::isnan(FromHalf(back))) << half;
    } else {
      ASSERT_EQ(back, half) << value;
    }
  }
}

TEST(Half, RoundsToTheNearestAndTiesToEven) {
  for (std::uint16_t half = 0; half < 0x7bff; ++half) {
    const auto next = static_cast<std::uint16_t>(half + 1);
    const float middle = (FromHalf(half) + FromHalf(next)) / 2;  // exact in float32
    ASSERT_EQ(ToHalf(middle), half % 2 == 0 ? half : next) << middle;
    ASSERT_EQ(ToHalf(std::nextafter(middle, 0.0f)), half) << middle;
    ASSERT_EQ(ToHalf(std::nextafter(middle, 1e9f)), next) << middle;
    ASSERT_EQ(ToHalf(-middle), 0x8000 | (half % 2 == 0 ? half : next)) << middle;
  }
}

}  // namespace tilegrad::half_test

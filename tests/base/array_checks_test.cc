// SPDX-License-Identifier: Apache-2.0
// On every target, for every length around whole vectors: a bad value is found at any position, and
// good ones are accepted.
#include "base/array_checks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/simd_target.h"

namespace tilegrad::array_checks_test {

template <class T>
void CheckFinite() {
  using Limits = std::numeric_limits<T>;
  const T fine[] = {0, T(-0.0), Limits::denorm_min(), Limits::max(), Limits::lowest()};
  const T bad[] = {Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN()};
  for (std::size_t n = 0; n < 100; ++n) {
    std::vector<T> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = fine[i % 5];
    EXPECT_TRUE(AllFinite(values)) << n;
    for (std::size_t i = 0; i < n; ++i) {
      for (const T wrong : bad) {
        const T right = std::exchange(values[i], wrong);
        EXPECT_FALSE(AllFinite(values)) << n << " " << i;
        values[i] = right;
      }
    }
  }
}

template <class T>
void CheckBelow() {
  using Limits = std::numeric_limits<T>;
  const T fine[] = {0, T(-0.0), Limits::denorm_min(), T(7.5), T(-7.5)};
  const T bad[] = {std::nextafter(T(7.5), T(8)), Limits::lowest(),    Limits::infinity(),
                   -Limits::infinity(),          Limits::quiet_NaN(), -Limits::quiet_NaN()};
  for (std::size_t n = 0; n < 100; ++n) {
    std::vector<T> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = fine[i % 5];
    EXPECT_TRUE(AllBelow(values, T(7.5))) << n;
    for (std::size_t i = 0; i < n; ++i) {
      for (const T wrong : bad) {
        const T right = std::exchange(values[i], wrong);
        EXPECT_FALSE(AllBelow(values, T(7.5))) << n << " " << i << " " << wrong;
        values[i] = right;
      }
    }
  }
}

void CheckWithin(std::int32_t least, std::int32_t end) {
  using Limits = std::numeric_limits<std::int32_t>;
  for (std::size_t n = 0; n < 100; ++n) {
    std::vector<std::int32_t> values(n, least);
    for (std::size_t i = 0; i < n; i += 2) values[i] = end - 1;
    EXPECT_TRUE(AllWithin(values, least, end));
    for (std::size_t i = 0; i < n; ++i) {
      for (const std::int32_t wrong : {Limits::min(), least - 1, end, Limits::max()}) {
        const std::int32_t right = std::exchange(values[i], wrong);
        EXPECT_FALSE(AllWithin(values, least, end)) << n << " " << i << " " << wrong;
        values[i] = right;
      }
    }
  }
}

TEST(ArrayChecks, FindWrongValuesOnEveryTarget) {
  for (const std::string& target : RunnableTargets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(ForceTarget(target).ok());
    CheckFinite<float>();
    CheckFinite<double>();
    CheckBelow<float>();
    CheckBelow<double>();
    CheckWithin(-1, 5000);
    CheckWithin(0, 1);
    CheckWithin(-7, 1 << 30);
    EXPECT_TRUE(AllWithin({}, 0, 0));
    EXPECT_FALSE(
        AllWithin(std::vector<std::int32_t>{0}, 0, std::numeric_limits<std::int32_t>::min()));
  }
  ASSERT_TRUE(ForceTarget("").ok());
}

}  // namespace tilegrad::array_checks_test

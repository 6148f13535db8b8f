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

#include "support/expect.h"

namespace tilegrad::array_checks_test {

// Of each bad value at each position of `good` ones, which repeat.
template <class T, class Check>
void ExpectFound(std::span<const T> good, std::span<const T> bad, const Check& check) {
  for (std::size_t n = 0; n < 100; ++n) {
    std::vector<T> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = good[i % good.size()];
    EXPECT_TRUE(check(values)) << n;
    for (std::size_t i = 0; i < n; ++i) {
      for (const T wrong : bad) {
        const T right = std::exchange(values[i], wrong);
        EXPECT_FALSE(check(values)) << n << " " << i << " " << wrong;
        values[i] = right;
      }
    }
  }
}

template <class T>
void CheckFloats() {
  using Limits = std::numeric_limits<T>;
  const T infinity = Limits::infinity(), nan = Limits::quiet_NaN();
  const T finite[] = {0, T(-0.0), Limits::denorm_min(), Limits::max(), Limits::lowest()};
  const T not_finite[] = {infinity, -infinity, nan};
  ExpectFound<T>(finite, not_finite, [](std::span<const T> values) { return AllFinite(values); });
  const T below[] = {0, T(-0.0), Limits::denorm_min(), T(7.5), T(-7.5)};
  const T above[] = {
      std::nextafter(T(7.5), T(8)), Limits::lowest(), infinity, -infinity, nan, -nan};
  ExpectFound<T>(below, above, [](std::span<const T> values) { return AllBelow(values, T(7.5)); });
}

void CheckWithin(std::int32_t least, std::int32_t end) {
  using Limits = std::numeric_limits<std::int32_t>;
  const std::int32_t good[] = {end - 1, least},
                     bad[] = {Limits::min(), least - 1, end, Limits::max()};
  ExpectFound<std::int32_t>(good, bad, [&](std::span<const std::int32_t> values) {
    return AllWithin(values, least, end);
  });
}

TEST(ArrayChecks, FindWrongValuesOnEveryTarget) {
  for (const std::string target : EveryTarget()) {
    CheckFloats<float>();
    CheckFloats<double>();
    CheckWithin(-1, 5000);
    CheckWithin(0, 1);
    CheckWithin(-7, 1 << 30);
    EXPECT_TRUE(AllWithin({}, 0, 0));
    EXPECT_FALSE(
        AllWithin(std::vector<std::int32_t>{0}, 0, std::numeric_limits<std::int32_t>::min()));
  }
}

}  // namespace tilegrad::array_checks_test

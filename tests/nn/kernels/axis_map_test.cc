// SPDX-License-Identifier: Apache-2.0
// The sparse map along an axis against the reference in double, on every target, over lengths with
// and without tails.
#include "nn/kernels/axis_map.h"

#include "nn/kernels/axis_map_ref.h"
#include "nn/kernels/kernel_test_util.h"

namespace tilegrad::nn::axis_map_test {

template <class T>
std::vector<T> Reference(AxisMapProblem<float> like, const std::vector<T>& x,
                         const std::vector<T>& weight) {
  std::vector<T> y(like.outer * like.out * like.inner);
  AxisMapRef(AxisMapProblem<T>{like.outer, like.in, like.out, like.inner, like.begin, like.index,
                               weight.data(), x.data(), y.data()},
             0, like.outer * like.out);
  return y;
}

TEST(AxisMap, EqualsReference) {
  Rng rng(31);
  // Row 1 has no terms, row 2 has four, of which two read the same element.
  const std::vector<std::int32_t> begin = {0, 1, 1, 5, 7}, index = {4, 0, 3, 3, 1, 2, 4};
  for (const std::size_t inner : {1, 2, 3, 8, 16, 37, 40000}) {
    const std::size_t outer = inner == 1 ? 30000 : 3;
    const auto x = RandomFloats(rng, outer * 5 * inner), weight = RandomFloats(rng, index.size());
    std::vector<float> y(outer * 4 * inner);
    const AxisMapProblem<float> problem{
        outer, 5, 4, inner, begin.data(), index.data(), weight.data(), x.data(), y.data()};
    const auto want = Reference(problem, AsDoubles(x), AsDoubles(weight));
    const auto magnitude = Reference(problem, Magnitudes(x), Magnitudes(weight));
    for (const std::string target : EveryTarget()) {
      std::vector<float> first;
      for (const int workers : {1, 2, 7}) {
        std::fill(y.begin(), y.end(), -77.0f);
        MapAxis(problem, Workers(workers));
        ExpectWithinRounding(y, want, magnitude, 4 + 1);
        if (first.empty()) first = y;
        EXPECT_EQ(y, first) << workers;
      }
    }
  }
}

// A nearest resize along the last axis: cuts of the work fall within rows.
TEST(AxisMap, OneTermEachAlongTheLastAxis) {
  Rng rng(32);
  const std::vector<std::int32_t> begin = {0, 1, 2, 3}, index = {1, 0, 1};
  const std::size_t outer = 20000;
  const auto x = RandomFloats(rng, outer * 2), weight = RandomFloats(rng, 3);
  std::vector<float> y(outer * 3);
  const AxisMapProblem<float> problem{
      outer, 2, 3, 1, begin.data(), index.data(), weight.data(), x.data(), y.data()};
  const std::vector<float> want = Reference(problem, x, weight);
  for (const std::string target : EveryTarget()) {
    for (const int workers : {1, 7}) {
      std::fill(y.begin(), y.end(), -77.0f);
      MapAxis(problem, Workers(workers));
      EXPECT_EQ(y, want);
    }
  }
}

}  // namespace tilegrad::nn::axis_map_test

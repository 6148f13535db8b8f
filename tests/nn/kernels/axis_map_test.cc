// SPDX-License-Identifier: Apache-2.0
// The sparse map along an axis against the reference in double, on every target, over lengths with
// and without tails.
#include "nn/kernels/axis_map.h"

#include "nn/kernels/axis_map_ref.h"
#include "nn/kernels/kernel_test_util.h"

namespace tilegrad::nn::axis_map_test {

template <class T>
SparseRows<T> Weighted(const SparseRows<float>& like, const std::vector<T>& weight) {
  return {like.in, like.out, like.begin, like.index, weight.data()};
}

template <class T>
std::vector<T> Reference(const AxisMapProblem<float>& like, const std::vector<T>& x,
                         const std::vector<T>& weight) {
  std::vector<T> y(like.outer * like.map.out * like.inner);
  AxisMapRef(
      AxisMapProblem<T>{like.outer, like.inner, Weighted(like.map, weight), x.data(), y.data()}, 0,
      like.outer * like.map.out);
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
        outer, inner, {5, 4, begin.data(), index.data(), weight.data()}, x.data(), y.data()};
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
      outer, 1, {2, 3, begin.data(), index.data(), weight.data()}, x.data(), y.data()};
  const std::vector<float> want = Reference(problem, x, weight);
  for (const std::string target : EveryTarget()) {
    for (const int workers : {1, 7}) {
      std::fill(y.begin(), y.end(), -77.0f);
      MapAxis(problem, Workers(workers));
      EXPECT_EQ(y, want);
    }
  }
}

template <class T>
std::vector<T> ImageReference(const ImageMapProblem<float>& like, const std::vector<T>& x,
                              const std::vector<T>& rows, const std::vector<T>& columns) {
  std::vector<T> y(like.outer * like.rows.out * like.columns.out), combined(like.columns.in);
  const ImageMapProblem<T> problem{like.outer, Weighted(like.rows, rows),
                                   Weighted(like.columns, columns), x.data(), y.data()};
  for (std::size_t row = 0; row < like.outer * like.rows.out; ++row)
    ImageMapRowRef(problem, row, combined.data());
  return y;
}

// Rows: a copy, a sum of two, a scaled one, none. Columns: a frame around neighbours, a sum, none.
TEST(ImageMap, EqualsReference) {
  Rng rng(33);
  const std::vector<std::int32_t> row_begin = {0, 1, 3, 4, 4}, row_index = {2, 0, 1, 1};
  const std::vector<float> row_weight = {1.0f, 0.25f, 0.75f, -2.0f};
  for (const std::int32_t width : {1, 2, 7, 16, 37}) {
    std::vector<std::int32_t> begin = {0, 1}, index = {width - 1};
    std::vector<float> weight = {1.0f};
    for (std::int32_t j = 0; j < width; ++j) {
      index.push_back(j);
      weight.push_back(1.0f);
      begin.push_back(static_cast<std::int32_t>(index.size()));
    }
    for (const float share : {0.5f, -1.5f}) {
      index.push_back(0);
      weight.push_back(share);
    }
    begin.insert(begin.end(), 2, static_cast<std::int32_t>(index.size()));
    const auto in = static_cast<std::size_t>(width);
    const std::size_t outer = 30000 / in;
    const auto x = RandomFloats(rng, outer * 3 * in);
    std::vector<float> y(outer * 4 * (begin.size() - 1));
    const ImageMapProblem<float> problem{
        outer,
        {3, 4, row_begin.data(), row_index.data(), row_weight.data()},
        {in, begin.size() - 1, begin.data(), index.data(), weight.data()},
        x.data(),
        y.data()};
    const auto want =
        ImageReference(problem, AsDoubles(x), AsDoubles(row_weight), AsDoubles(weight));
    const auto magnitude =
        ImageReference(problem, Magnitudes(x), Magnitudes(row_weight), Magnitudes(weight));
    for (const std::string target : EveryTarget()) {
      std::vector<float> first;
      for (const int count : {1, 2, 7}) {
        std::fill(y.begin(), y.end(), -77.0f);
        const Workers workers(count);
        KernelScratch scratch;
        MapImage(problem, KernelContext{workers, scratch});
        ExpectWithinRounding(y, want, magnitude, 2 * 2 + 2);  // two sums of two products
        if (first.empty()) first = y;
        EXPECT_EQ(y, first) << count;
      }
    }
  }
}

}  // namespace tilegrad::nn::axis_map_test

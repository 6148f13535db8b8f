// SPDX-License-Identifier: Apache-2.0
// The eight optimisations of the paper's Figure 2, small.
#include "fit/figure2.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tilegrad::train::figure2_test {

constexpr Figure2Options kSmall{.size = 48, .steps = 300};

TEST(Figure2, EachOfTheEightReachesAtMostFivePercentOfItsStart) {
  const Workers workers(2);
  const std::vector<Figure2Case> cases = Figure2Cases(kSmall.size);
  ASSERT_EQ(cases.size(), 8u);
  for (const Figure2Case& one : cases) {
    const auto result = RunFigure2Case(one, kSmall, workers);
    ASSERT_TRUE(result.ok()) << one.label << ": " << result.status().message();
    EXPECT_GT(result->losses.front(), 0.005) << one.label << ": nothing to do";
    EXPECT_LE(result->remaining(), 0.05) << one.label;
  }
}

TEST(Figure2, SameBitsForAnyNumberOfWorkers) {
  constexpr Figure2Options few{.size = 32, .steps = 6};
  for (const Figure2Case& one : Figure2Cases(few.size)) {
    std::vector<std::vector<double>> losses;
    for (const int count : {1, 2, 7}) {
      const Workers workers(count);
      const auto result = RunFigure2Case(one, few, workers);
      ASSERT_TRUE(result.ok()) << one.label << ": " << result.status().message();
      losses.push_back(result->losses);
    }
    EXPECT_EQ(losses[0], losses[1]) << one.label;
    EXPECT_EQ(losses[0], losses[2]) << one.label;
  }
}

TEST(Figure2, PictureAndTableHoldEveryRow) {
  const Workers workers(1);
  const StopFlag stop = false;
  const auto results = RunFigure2({.size = 16, .steps = 1}, workers, {}, stop);
  ASSERT_TRUE(results.ok()) << results.status().message();
  const auto svg = Figure2Svg(*results);
  ASSERT_TRUE(svg.ok());
  const std::string table = Figure2Table(*results);
  for (const Figure2Result& r : *results) {
    EXPECT_NE(svg->find("(" + r.label + ") " + r.model), std::string::npos);
    EXPECT_NE(table.find("| " + r.label + " |"), std::string::npos);
  }
  std::size_t images = 0;
  for (std::size_t at = 0; (at = svg->find("<image", at)) != std::string::npos; ++at) ++images;
  EXPECT_EQ(images, 24u);
}

TEST(Figure2, StopsWhenAsked) {
  const Workers workers(1);
  const StopFlag stop = true;
  EXPECT_EQ(RunFigure2({}, workers, {}, stop).status().code(), StatusCode::kCancelled);
}

}  // namespace tilegrad::train::figure2_test

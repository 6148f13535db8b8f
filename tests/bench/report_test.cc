// SPDX-License-Identifier: Apache-2.0
// From the JSON of Google Benchmark to tables and curves.
#include <gtest/gtest.h>

#include <algorithm>

#include "report/tables.h"
#include "support/expect.h"

namespace tilegrad::bench::report_test {

std::string Sample(const std::string& name, double cpu, double wall, const std::string& more) {
  return R"({"run_name":")" + name + R"(/process_time/real_time","run_type":"iteration",)" +
         R"("cpu_time":)" + std::to_string(cpu) + R"(,"real_time":)" + std::to_string(wall) + more +
         "}";
}

std::vector<Measurement> Parse(const std::string& samples) {
  return Ok(ParseMeasurements(R"({"benchmarks":[)" + samples + "]}")).value();
}

const std::string kLimits = R"(,"limit_ms":0.5,"limit_high_ms":1.0,"share":1,"faces":7)";

const std::string kSamples =
    Sample("S1/forward/both/1", 3, 4, kLimits) + "," + Sample("S1/forward/both/1", 2, 4, kLimits) +
    "," + Sample("S1/forward/both/1", 9, 3, kLimits) + "," + Sample("S1/forward/both/2", 4, 2, "") +
    "," + Sample("S1/forward/both/culled", 30, 30, "") + "," +
    Sample("S1/forward/both/naive", 15, 16, R"(,"share":0.01)") + "," +
    Sample("S1/backward/both/1", 1, 1, R"(,"error_occurred":true)") + "," +
    Sample("delta-0.01/forward/both/1", 5, 6, "") + "," +
    Sample("delta-1/forward/both/1", 50, 60, "") + "," +
    Sample("delta-0.01/forward/both/culled", 500, 600, "");

TEST(BenchReport, MediansOfRepetitionsScaledToTheWholeBatch) {
  const auto all = Parse(kSamples);
  ASSERT_EQ(all.size(), 7u);  // the one with an error is left out
  EXPECT_EQ(all[0].scene + all[0].direction + all[0].what + all[0].who, "S1forwardboth1");
  EXPECT_EQ(all[0].repetitions, 3);
  EXPECT_EQ(all[0].cpu_ms, 3);
  EXPECT_EQ(all[0].wall_ms, 4);
  EXPECT_EQ(Find(all, all[0], "naive")->cpu_ms, 1500);
  EXPECT_EQ(Find(all, all[0], "nobody"), nullptr);
}

TEST(BenchReport, CountersWithoutVariationAreRead) {
  const std::string cv =
      R"({"run_name":"S1/forward/both/1","run_type":"aggregate","evaluated_pairs": NaN,)"
      R"("evaluated_exps": NaN})";
  const auto all = Parse(Sample("S1/forward/both/1", 1, 1, R"(,"evaluated_pairs":0)") + "," + cv);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].repetitions, 1);
}

TEST(BenchReport, SpeedTableHasRatiosAndLimits) {
  const std::string table = SpeedTable(Parse(kSamples));
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 3);  // head, line, one row
  ExpectIn(table, "| S1 | forward | both | 3.00 |  | 10 | 500 | 2.00 | 0.50-1.00 | 17-33 % |\n");
}

TEST(BenchReport, RequestTableHasRatiosToTheSilhouette) {
  const auto all = Parse(Sample("S2/forward/silhouette/shaded", 4, 4, "") + "," +
                         Sample("S2/backward/silhouette/shaded", 5, 5, "") + "," +
                         Sample("S2/forward/trilinear texture/shaded", 10, 9, "") + "," +
                         Sample("S2/backward/trilinear texture/shaded", 15, 9, ""));
  const std::string table = RequestTable(all);
  ExpectIn(table, "| S2 | silhouette | 4.00 | 1.00 | 5.00 | 1.00 |",
           "| S2 | trilinear texture | 10.00 | 2.50 | 15.00 | 3.00 |");
  EXPECT_TRUE(RequestTable(Parse(kSamples)).empty());
}

TEST(BenchReport, GrowthAsCurvesAndTable) {
  const auto all = Parse(kSamples);
  const train::LogPlot plot = GrowthPlot(all, "delta");
  ASSERT_EQ(plot.series.size(), 2u);
  ASSERT_EQ(plot.series[0].points.size(), 2u);
  EXPECT_EQ(plot.series[0].points[1].x, 1);
  EXPECT_EQ(plot.series[0].points[1].y, 50);
  ExpectIn(GrowthTable(all, "delta"), "| 0.01 | 5 | 500 |\n| 1 | 50 |  |\n");
  EXPECT_TRUE(GrowthTable(all, "faces").empty());
}

TEST(BenchReport, RefusesOtherFiles) {
  EXPECT_FALSE(ParseMeasurements("").ok());
  EXPECT_FALSE(ParseMeasurements("{}").ok());
  EXPECT_FALSE(ParseMeasurements(R"({"benchmarks":[]})").ok());
  EXPECT_FALSE(ParseMeasurements(R"({"benchmarks":[{"run_type":"iteration"}]})").ok());
}

TEST(LogPlotSvg, DrawsPointsWhereTheyBelongAndEscapesTexts) {
  const std::string svg =
      train::LogPlotSvg({"a & b", "y", {{{"<s>"}, {{1, 1, ""}, {100, 10, ""}}}}});
  EXPECT_EQ(svg.rfind("<svg", 0), 0u);
  ExpectIn(svg, "points=\"80.0,384.0 470.0,24.0 \"", "a &amp; b", "&lt;s&gt;");
  ExpectIn(train::LogPlotSvg({"x", "y", {}}), "</svg>");
}

}  // namespace tilegrad::bench::report_test

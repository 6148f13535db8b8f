// SPDX-License-Identifier: Apache-2.0
// Tables of scores: names of classes are text, whatever they hold.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "support/temp_folder.h"
#include "train/eval/evaluation.h"
#include "train/eval/paired.h"

namespace tilegrad::train::evaluation_table_test {

Evaluation Named(const std::string& name) {
  Evaluation e;
  e.predictor = name;
  e.split = "test";
  e.views_per_model = 1;
  e.classes = {name};
  e.class_models = {1};
  e.rows = {{name, {{0.5, 0.25}}, {0.5, 0.25}}};
  e.models = {{name, name, {0.5, 0.25}}};
  return e;
}

TEST(EvaluationTable, MarkdownHoldsNoHtmlAndNoFurtherCells) {
  const std::string text = FormatMarkdown(Named("<b onclick=x>|[y](z)\n*"));
  EXPECT_EQ(text.find('<'), std::string::npos) << text;
  EXPECT_NE(text.find("&lt;b onclick=x&gt;\\|\\[y\\](z)\\\\n\\*"), std::string::npos) << text;
  // The table's lines: heading, dashes, one method; three cells each.
  int lines = 0;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with('|')) continue;
    ++lines;
    int bars = 1;  // the first
    for (std::size_t i = 1; i < line.size(); ++i) bars += line[i] == '|' && line[i - 1] != '\\';
    EXPECT_EQ(bars, 4) << line;
  }
  EXPECT_EQ(lines, 3);
}

using WrittenEvaluation = TempFolderTest;

TEST_F(WrittenEvaluation, NamesNeedNotBeUtf8) {
  ASSERT_TRUE(WriteEvaluation(folder_, Named("caf\xe9")).ok());
  const auto back = ReadEvaluation(folder_);
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ((*back)->classes[0], "caf\xe9");
  EXPECT_NE(ReadText(folder_ / "eval.md").value().find("caf\\\\xe9"), std::string::npos);
}

// Standard errors and paired differences, on numbers worked out by hand.

// Squares about the means 2 and 6: 2 + 2 of two degrees of freedom, so a variance of 2; the mean of
// the classes has that of (2/2 + 2/2) / 4. A third class of one shape adds 2/1 and no freedom.
TEST(StandardErrors, AreThoseOfAMeanOverClasses) {
  const std::vector<std::vector<double>> two = {{1, 3}, {5, 7}, {}};
  EXPECT_EQ(MeanOverClasses(two).mean, 4);
  EXPECT_NEAR(*MeanOverClasses(two).error, std::sqrt(0.5), 1e-12);
  const std::vector<std::vector<double>> three = {{1, 3}, {5, 7}, {7}};
  EXPECT_EQ(MeanOverClasses(three).mean, 5);
  EXPECT_NEAR(*MeanOverClasses(three).error, std::sqrt(4.0) / 3, 1e-12);
  const std::vector<std::vector<double>> single = {{1}, {2}};
  EXPECT_FALSE(MeanOverClasses(single).error);
}

Evaluation Scored(const std::string& name, const std::vector<double>& ious) {
  Evaluation out;
  out.predictor = name;
  out.split = "test";
  out.views_per_model = 1;
  out.classes = {"chair"};
  out.class_models = {static_cast<int>(ious.size())};
  out.rows = {{name, {{ious[0], 0.5}}, {ious[0], 0.5}}};
  for (std::size_t m = 0; m < ious.size(); ++m)
    out.models.push_back({"chair", std::to_string(m), {.iou = ious[m], .f_score = 0.5}});
  return out;
}

const PairedDifference& IouOf(const PairedComparison& comparison) { return comparison.measures[0]; }

// Models differ by 0.3, runs by 0.02 to 0.04: their means are within each other's errors, their
// differences far from 0.
TEST(Paired, FindsADifferenceThatMeansHide) {
  const Evaluation first = Scored("first", {0.22, 0.54, 0.83}),
                   second = Scored("second", {0.2, 0.5, 0.8});
  const PairedComparison comparison = ComparePaired(first, second).value();
  EXPECT_EQ(comparison.models, 3);
  EXPECT_NEAR(IouOf(comparison).difference.mean, 0.03, 1e-12);
  EXPECT_NEAR(*IouOf(comparison).difference.error, std::sqrt(0.0001 / 3), 1e-12);
  EXPECT_FALSE(IouOf(comparison).tie());
  EXPECT_TRUE(IouOf(comparison).better());
  EXPECT_FALSE(IouOf(ComparePaired(second, first).value()).better());
  const std::string text = FormatComparison(comparison);
  EXPECT_NE(text.find("3D IoU                  +3.0 ± 0.6  better"), std::string::npos) << text;
  EXPECT_NE(text.find("F-score                 +0.0 ± 0.0  a tie"), std::string::npos) << text;
  EXPECT_EQ(ComparisonJson(comparison)["measures"]["iou"]["verdict"], "better");
}

TEST(Paired, SmallDifferencesAreTies) {
  const auto comparison =
      ComparePaired(Scored("a", {0.3, 0.5, 0.8}), Scored("b", {0.2, 0.55, 0.8}));
  EXPECT_TRUE(IouOf(*comparison).tie());
}

// Two liveries of one shape count as one: without that, the error would be half as large.
TEST(Paired, ModelsOfAShapeCountOnce) {
  Evaluation first = Scored("a", {0.3, 0.3, 0.5, 0.5}), second = Scored("b", {0.2, 0.2, 0.5, 0.5});
  for (std::size_t m = 0; m < 4; ++m) first.models[m].shape = m < 2 ? "one" : "two";
  const PairedComparison comparison = ComparePaired(first, second).value();
  const ClassedMean& difference = IouOf(comparison).difference;
  EXPECT_NEAR(difference.mean, 0.05, 1e-12);
  EXPECT_NEAR(*difference.error, 0.05, 1e-12);
}

// Of two measures on which less is better, the lower is the better one; what one lacks is left out.
TEST(Paired, KnowsWhichWayIsBetterAndWhatBothHave) {
  Evaluation first = Scored("a", {0.3, 0.5}), second = first;
  for (ModelScore& model : first.models) model.score.color_l1 = 0.1;
  for (ModelScore& model : second.models) model.score.color_l1 = 0.2;
  first.models[1].score.color_l1 = 0.11;
  first.models[0].score.texture_l1 = 0.1;
  const PairedComparison comparison = ComparePaired(first, second).value();
  ASSERT_EQ(comparison.measures.size(), 3u);
  EXPECT_STREQ(comparison.measures[2].measure->key, "color_l1");
  EXPECT_TRUE(comparison.measures[2].better());
}

TEST(Paired, WithoutACommonModelIsAnError) {
  Evaluation other = Scored("other", {0.5});
  other.models[0].id = "x";
  ExpectMessage(ComparePaired(Scored("a", {0.5}), other).status(), "other");
}

using WrittenErrors = TempFolderTest;

TEST_F(WrittenErrors, ComeBackAndAreShown) {
  Evaluation evaluation = Scored("a", {0.5, 0.7});
  evaluation.rows[0].mean = {.iou = 0.6, .f_score = 0.5, .light_angle = 30};
  evaluation.rows[0].error = Score{.iou = 0.1, .f_score = 0.02, .light_angle = 2};
  evaluation.models[0].shape = "one";
  EvaluationRow constant = evaluation.rows[0];
  constant.method = kMeanLightRow;
  constant.mean.light_angle = 60;
  evaluation.rows.insert(evaluation.rows.begin(), constant);
  const std::string table = FormatTable(evaluation);
  for (const char* part : {"60.0 ± 10.0 / 50.0 ± 2.0", "30.0 ± 2.0", "light / constant", "0.50"})
    EXPECT_NE(table.find(part), std::string::npos) << part << "\n" << table;
  ASSERT_TRUE(WriteEvaluation(folder_, evaluation).ok());
  const auto back = ReadEvaluation(folder_);
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ((*back)->rows[1].error->light_angle, 2);
  EXPECT_EQ((*back)->models[0].shape, "one");
  EXPECT_EQ(EvaluationJson(**back)["rows"][1]["light_of_constant"], 0.5);
}

}  // namespace tilegrad::train::evaluation_table_test

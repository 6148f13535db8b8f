// SPDX-License-Identifier: Apache-2.0
// Scores, and the search for the nearest picture, on numbers worked out by hand.
#include "train/eval/scores.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"
#include "train/eval/evaluate.h"
#include "train/eval/evaluation.h"
#include "train/eval/statistics.h"

namespace tilegrad::train::scores_test {

TEST(Scores, AShapeIsLikeItself) {
  const Mesh ball = Icosphere(3, 0.2f);
  const Shape shape = ShapeOf(ball, 1).value();
  const Score score = Compare(shape, shape);
  EXPECT_EQ(score.iou, 1);
  EXPECT_EQ(score.carved_iou, 1);
  EXPECT_EQ(score.f_score, 1);
  EXPECT_FALSE(score.color_l1);
}

TEST(Scores, WithoutAMeshOnlyTheVoxelsCount) {
  ModelData data;
  data.occupancy.assign(std::size_t{32} * 32 * 32, 1);
  const Shape truth = TruthShape(data).value();
  const Score score = Compare(ShapeOf(Box({0, 0, 0}, {2, 2, 2}), 1).value(), truth);
  EXPECT_EQ(score.iou, 1);
  EXPECT_FALSE(score.f_score || score.carved_iou);
  EXPECT_FALSE(WorstScore(truth).f_score);
  EXPECT_EQ(WorstScore(truth).iou, 0);
}

TEST(Scores, TheMeanHasWhatAllHave) {
  const Score a{.iou = 0.5, .f_score = 0.2, .carved_iou = 0.4, .color_l1 = 0.25};
  Score b{.iou = 0.75, .f_score = 0.4, .carved_iou = std::nullopt, .color_l1 = 0.75};
  const Score both[] = {a, b};
  const Score mean = MeanScore(both);
  EXPECT_EQ(mean.iou, 0.625);
  EXPECT_NEAR(*mean.f_score, 0.3, 1e-15);
  EXPECT_FALSE(mean.carved_iou);
  EXPECT_EQ(mean.color_l1, 0.5);
}

// Two pixels: one covered by both, one by neither.
TEST(Scores, ColoursCountWhereEitherCovers) {
  const std::vector<std::uint8_t> a = {255, 0, 51, 0, 0, 0, 255, 0};
  const std::vector<std::uint8_t> b = {0, 0, 51, 0, 102, 0, 255, 0};
  ColorDifference difference;
  difference.Add(a, b);
  Score score;
  difference.To(&score);
  EXPECT_EQ(difference.either.count, 3u);
  EXPECT_NEAR(*score.color_l1, (1.0 + 0 + 0.4) / 3, 1e-12);
  EXPECT_EQ(score.shared_color_l1, score.color_l1);  // both cover all of it
  EXPECT_FALSE(score.seen_color_l1 || score.hidden_color_l1);
  ColorDifference{}.To(&score);
  EXPECT_EQ(score.color_l1, 0);
  EXPECT_EQ(score.shared_color_l1, 1);
}

// Four pixels: both cover the first; parts of the second, painted 1/2 and 1; a alone the third, and
// b nearly alone the fourth, of which `shared` knows nothing.
TEST(Scores, WhereBothAreOutlinesDoNotCount) {
  const auto planes = [](std::array<std::uint8_t, 4> grey, std::array<std::uint8_t, 4> alpha) {
    std::vector<std::uint8_t> out;
    for (int c = 0; c < 3; ++c) out.insert(out.end(), grey.begin(), grey.end());
    out.insert(out.end(), alpha.begin(), alpha.end());
    return out;
  };
  const std::vector<Side> sides = {Side::kSeen, Side::kHidden, Side::kSeen, Side::kHidden};
  ColorDifference difference;
  difference.Add(planes({255, 100, 255, 5}, {255, 200, 255, 10}),
                 planes({204, 128, 0, 255}, {255, 128, 0, 255}), sides);
  Score score;
  difference.To(&score);
  EXPECT_NEAR(*score.color_l1, (51 + 28 + 255 + 250) / 255.0 / 4, 1e-12);
  EXPECT_NEAR(*score.shared_color_l1, (0.2 + 0.5) / 2, 1e-12);
  EXPECT_NEAR(*score.seen_color_l1, 0.2, 1e-12);
  EXPECT_NEAR(*score.hidden_color_l1, 0.5, 1e-12);
}

TEST(PredictionPictures, ShowUnlitColours) {
  DatasetInfo info;
  info.image_size = info.camera.lens.width = info.camera.lens.height = 16;
  PredictionPictures pictures(info, {0, 5});
  Mesh ball = Icosphere(3, 0.45f);
  ball.colors.assign(ball.positions.size(), {1.0f, 0.2f, 0.0f, 1.0f});
  const auto images = pictures.Draw(ball).value().rgba;
  ASSERT_EQ(images.size(), 2u * 4 * 16 * 16);
  const std::size_t centre = 8 * 16 + 8;
  for (std::size_t v = 0; v < 2; ++v) {
    const std::uint8_t* image = &images[v * 4 * 256];
    EXPECT_EQ(image[centre], 255);
    EXPECT_EQ(image[256 + centre], 51);
    EXPECT_EQ(image[512 + centre], 0);
    EXPECT_EQ(image[768 + centre], 255);
    EXPECT_EQ(image[768], 0);
  }
  Mesh broken;
  broken.positions = {glm::vec3(0)};
  broken.faces = {{0, 0, 9}};
  EXPECT_FALSE(pictures.Draw(broken).ok());
}

// Of a ball, the view itself shows all that it sees, and the one from behind nearly nothing.
TEST(PredictionPictures, KnowWhichSidesAViewSees) {
  DatasetInfo info;
  info.image_size = info.camera.lens.width = info.camera.lens.height = 16;
  info.camera.elevation = 0;
  PredictionPictures pictures(info, {0, 12});
  Mesh ball = Icosphere(3, 0.45f);
  ball.colors.assign(ball.positions.size(), glm::vec4(1));
  const auto drawn = pictures.Draw(ball, 0).value();
  ASSERT_EQ(drawn.sides.size(), 2u * 16 * 16);
  const auto count = [&](std::size_t view, Side side) {
    const auto from = drawn.sides.begin() + static_cast<std::ptrdiff_t>(view * 256);
    return std::count(from, from + 256, side);
  };
  EXPECT_GT(count(0, Side::kSeen), 80);
  // But for pixels of faces at the outline.
  EXPECT_LE(count(0, Side::kHidden), 2);
  EXPECT_LE(count(1, Side::kSeen), 2);
  EXPECT_NEAR(count(1, Side::kHidden), count(0, Side::kSeen), 4);
  EXPECT_TRUE(pictures.Draw(ball).value().sides.empty());
}

// Tables of scores: names of classes are text, whatever they hold.

// Of models of one class: their 3D IoU.
Evaluation Scored(const std::string& name, const std::vector<double>& ious,
                  const std::string& class_name = "chair") {
  Evaluation out;
  out.predictor = name;
  out.split = "test";
  out.views_per_model = 1;
  out.classes = {class_name};
  out.class_models = {static_cast<int>(ious.size())};
  out.rows = {{name, {{ious[0], 0.5}}, {ious[0], 0.5}}};
  for (std::size_t m = 0; m < ious.size(); ++m)
    out.models.push_back({class_name, std::to_string(m), {.iou = ious[m], .f_score = 0.5}});
  return out;
}

Evaluation Named(const std::string& name) {
  Evaluation out = Scored(name, {0.5}, name);
  out.models[0].id = name;
  return out;
}

TEST(EvaluationTable, MarkdownHoldsNoHtmlAndNoFurtherCells) {
  const std::string text = FormatMarkdown(Named("<b onclick=x>|[y](z)\n*"));
  EXPECT_EQ(text.find('<'), std::string::npos) << text;
  ExpectIn(text, "&lt;b onclick=x&gt;\\|\\[y\\](z)\\\\n\\*");
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
  const auto back = Ok(ReadEvaluation(folder_));
  EXPECT_EQ((*back)->classes[0], "caf\xe9");
  ExpectIn(ReadText(folder_ / "eval.md").value(), "caf\\\\xe9");
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
  ExpectIn(text, "3D IoU                  +3.0 ± 0.6  better",
           "F-score                 +0.0 ± 0.0  a tie");
  EXPECT_EQ(ComparisonJson(comparison)["measures"]["iou"]["verdict"], "better");
}

TEST(Paired, SmallDifferencesAreTies) {
  const auto comparison =
      ComparePaired(Scored("a", {0.3, 0.5, 0.8}), Scored("b", {0.2, 0.55, 0.8}));
  EXPECT_TRUE(IouOf(*comparison).tie());
}

TEST(Paired, OneModelTellsNothing) {
  const auto comparison = Ok(ComparePaired(Scored("a", {0.3}), Scored("b", {0.2})));
  ExpectIn(FormatComparison(*comparison), "+10.0 ± ?  too few models to tell");
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
  ExpectIn(table, "60.0 ± 10.0 / 50.0 ± 2.0", "30.0 ± 2.0", "light / constant", "0.50",
           "error of the mean over models, ");  // of any split
  ASSERT_TRUE(WriteEvaluation(folder_, evaluation).ok());
  const auto back = Ok(ReadEvaluation(folder_));
  EXPECT_EQ((*back)->rows[1].error->light_angle, 2);
  EXPECT_EQ((*back)->models[0].shape, "one");
  EXPECT_EQ(EvaluationJson(**back)["rows"][1]["light_of_constant"], 0.5);
}

// A shape counts once in the scores of its class, however many liveries it has.

class EvaluateShapesTest : public TempFolderTest {
 protected:
  void SetUp() override {
    BuildOptions options;
    options.image_size = 8;
    options.views = 1;
    ASSERT_TRUE(BuildDataset(*ProceduralSource(6, 0), options, folder_, Workers(1), {}).ok());
  }

  // Of each class: models 0 and 1 to train on, 2 to 5 to test with, of which 2, 3 and 4 are
  // `shape`.
  Dataset WithShape(const std::string& shape) const {
    Dataset before = Dataset::Open(folder_).value();
    std::vector<ModelInfo> models = before.models();
    for (std::size_t m = 0; m < models.size(); ++m) {
      models[m].split = m % 6 < 2 ? Split::kTrain : Split::kTest;
      if (m % 6 >= 2 && m % 6 < 5) models[m].shape = shape;
    }
    EXPECT_TRUE(WriteModels(folder_, before.info(), models).ok());
    return Dataset::Open(folder_).value();
  }

  // Predicts a ball, then ever flatter boxes, so that scores differ.
  static Result<Evaluation> Score(
      const Dataset& dataset,
      const std::function<void(EvaluationJob&)>& change = [](EvaluationJob&) {}) {
    float height = 1;
    EvaluationJob job;
    job.dataset = &dataset;
    job.template_mesh = Icosphere(1, 1);
    job.views_per_model = 1;
    job.predict = [&](std::span<const std::uint8_t>) {
      height *= 0.9f;
      return Result<std::vector<Mesh>>({Box(glm::vec3(0), {1, height, 1})});
    };
    change(job);
    return Evaluate(job, Workers(1), {});
  }
};

TEST_F(EvaluateShapesTest, LiveriesAreAveragedFirst) {
  for (const char* shape : {"", "one"}) {
    const auto scored = Ok(Score(WithShape(shape)));
    const EvaluationRow& row = scored->rows.back();
    ASSERT_EQ(scored->models.size(), 4 * row.classes.size());
    for (std::size_t c = 0; c < row.classes.size(); ++c) {
      const auto iou = [&](std::size_t m) { return scored->models[4 * c + m].score.iou; };
      const double liveries = iou(0) + iou(1) + iou(2), other = iou(3);
      const double expected =
          shape[0] == '\0' ? (liveries + other) / 4 : (liveries / 3 + other) / 2;
      EXPECT_NEAR(row.classes[c].iou, expected, 1e-12);  // sums of four numbers up to 1
      EXPECT_EQ(scored->class_models[c], 4);
    }
  }
}

// Of six models a class two are trained on; what is searched is spread over all of them.
TEST_F(EvaluateShapesTest, TheNearestPictureIsOfTrainingModelsThatItMayKnow) {
  const Dataset dataset = WithShape("");
  const auto names = [](const Evaluation& evaluation) {
    std::vector<std::string> out;
    for (const EvaluationRow& row : evaluation.rows) out.push_back(row.method);
    return out;
  };
  const std::vector<std::string> three = {"undeformed template", "best single shape", "tilegrad"};
  const std::vector<std::string> four = {three[0], three[1], "nearest training picture", three[2]};
  const auto all = static_cast<int>(dataset.Select(Split::kTrain).size());
  const auto score = [&](Split split, int searched) {
    return Score(dataset,
                 [=](EvaluationJob& job) {
                   job.split = split;
                   job.retrieval_models = searched;
                 })
        .value();
  };
  EXPECT_EQ(score(Split::kTest, 1000).retrieval_models, all);
  EXPECT_EQ(names(score(Split::kTest, 1000)), four);
  EXPECT_EQ(score(Split::kTest, 3).retrieval_models, 3);
  EXPECT_EQ(names(score(Split::kTest, 3)), four);
  EXPECT_EQ(names(score(Split::kTest, 0)), three);
  EXPECT_EQ(names(score(Split::kTrain, 1000)), three);  // each would find itself
}

}  // namespace tilegrad::train::scores_test

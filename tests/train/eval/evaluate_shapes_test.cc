// SPDX-License-Identifier: Apache-2.0
// A shape counts once in the scores of its class, however many liveries it has.
#include <gtest/gtest.h>

#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"
#include "train/eval/evaluate.h"

namespace tilegrad::train::evaluate_shapes_test {

class EvaluateShapesTest : public TempFolderTest {
 protected:
  void SetUp() override {
    BuildOptions options;
    options.image_size = 8;
    options.views = 1;
    const StopFlag stop = false;
    ASSERT_TRUE(BuildDataset(*ProceduralSource(6, 0), options, folder_, Workers(1), {}, stop).ok());
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
    const StopFlag stop = false;
    return Evaluate(job, Workers(1), {}, stop);
  }
};

TEST_F(EvaluateShapesTest, LiveriesAreAveragedFirst) {
  for (const char* shape : {"", "one"}) {
    const auto scored = Score(WithShape(shape));
    ASSERT_TRUE(scored.ok()) << scored.status().message();
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

}  // namespace tilegrad::train::evaluate_shapes_test

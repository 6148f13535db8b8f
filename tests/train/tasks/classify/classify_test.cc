// SPDX-License-Identifier: Apache-2.0
// The classifier as a run: it learns, is scored and reported, and serves as the network of a
// perceptual loss. Its bits: every_task_test.cc.
#include <gtest/gtest.h>

#include <numeric>

#include "base/rng.h"
#include "nn/nn.h"
#include "train/data/dataset_files.h"
#include "train/run/log.h"
#include "train/tasks/classify/model.h"
#include "train/tasks/classify/perceptual_network.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::classify_test {

constexpr int kSize = 16;

// Noise with more red, green or blue in it, by class.
Status WriteColored(const Path& folder, const std::vector<std::string>& classes) {
  const int count = static_cast<int>(classes.size());
  return WriteNoiseData(folder, {.meshes = Meshes::kBoxes,
                                 .classes = classes,
                                 .size = kSize,
                                 .train = 5 * count,
                                 .test = 2 * count,
                                 .paint = [](int class_index, int channel, Rng& rng) {
                                   const auto noise = static_cast<int>(rng.Below(150));
                                   return channel == 3 ? 255
                                                       : noise + (channel == class_index ? 70 : 0);
                                 }});
}

class ClassifyTest : public TinyRunTest {
 protected:
  void SetUp() override { Ok(WriteColored(folder_ / "data", {"blue", "green", "red"})); }
  Status TrainRun(const std::vector<std::string>& settings = {}) const {
    const std::string config = kTinyClassifier + "steps = 60\nshift = 2\n";
    return Train({.config = config, .settings = settings}).status();
  }
  Path Trained() {
    Ok(TrainRun());
    return folder_ / "run";
  }
  nn::Context context_{workers_};
};

TEST_F(ClassifyTest, LearnsAndIsScoredAndReported) {
  const Path run = Trained();
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000060.png"));
  const auto log = Ok(ReadLog(run));
  EXPECT_LT(log->back().values[0].second, 0.7 * log->front().values[0].second);

  const auto predictor = Ok(Predictor::Load(run, workers_));
  EXPECT_TRUE(predictor->template_mesh().positions.empty());
  ExpectMessage(predictor->Predict(std::vector<std::uint8_t>(4 * kSize * kSize)).status(),
                "predicts no meshes");
  const auto evaluation = Ok(Evaluate("run", "data"));
  ASSERT_EQ(evaluation->rows.size(), 3u);
  EXPECT_NEAR(evaluation->rows[0].mean.main(), 1.0 / 3, 1e-12);
  EXPECT_GT(evaluation->rows[2].mean.main(), 0.9);
  ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());
  const auto back = Ok(ReadEvaluation(run));
  EXPECT_EQ((*back)->rows[2].mean.accuracy, evaluation->rows[2].mean.accuracy);
  ExpectNotIn(*ReadText(run / "eval.json"), "\"iou\"");
  const std::string table = FormatTable(*evaluation);
  ExpectIn(table, "Accuracy (%) on 6 models of the test split, 4 views");
  ExpectNotIn(table, "IoU");

  const std::string page = Page("run", "data", 3);
  ExpectIn(page, "to classify an object", "Mean accuracy on", "nearest training picture",
           "most frequent class", "called red", "accuracy, %");
  ExpectNotIn(page, "3D IoU at");
}

TEST_F(ClassifyTest, OtherClassesAreRefused) {
  const Path run = Trained();
  ASSERT_TRUE(WriteColored(folder_ / "other", {"blue", "red"}).ok());
  std::filesystem::remove(run / "training_models.txt");  // which would be refused before
  ExpectMessage(Evaluate("run", "other").status(), "other", "2 classes",
                "3 that the network was trained on");
}

TEST_F(ClassifyTest, OneClassIsNothingToLearn) {
  std::filesystem::remove_all(folder_ / "data");
  ASSERT_TRUE(WriteColored(folder_ / "data", {"red"}).ok());
  ExpectMessage(TrainRun(), "1 class;", "two or more");
}

TEST_F(ClassifyTest, ImagesTooSmallForTheLevelsAreRefused) {
  ExpectMessage(TrainRun({"network.levels=6"}), "16 pixels", "at least 32");
}

TEST_F(ClassifyTest, PicturesAreMovedAndMirrored) {
  LabelledImages data;
  data.images.models = data.images.views = 1;
  data.images.size = 2;
  data.images.bytes.Resize(16);
  std::iota(data.images.bytes.begin(), data.images.bytes.end(), std::uint8_t{1});
  data.labels = {7};
  const Sample samples[] = {{0, {0}}, {0, {0}, true}, {0, {0}}};
  const Shift shifts[] = {{}, {}, {1, -1}};
  const LabelledBatch batch = GatherLabelled(context_, data, samples, shifts);
  EXPECT_EQ(batch.labels.data<std::int32_t>()[2], 7);
  std::vector<int> bytes;
  for (const float x : batch.images.span<float>())
    bytes.push_back(static_cast<int>(std::lround(255 * x)));
  const std::vector<int> want = {1, 2, 3, 4, 5, 6, 7, 8, 9,  10, 11, 12,  // as it is
                                 2, 1, 4, 3, 6, 5, 8, 7, 10, 9,  12, 11,  // mirrored
                                 0, 3, 0, 0, 0, 7, 0, 0, 0,  11, 0,  0};  // right and up
  EXPECT_EQ(bytes, want);
  for (std::uint64_t i = 0; i < 100; ++i) {
    const Shift shift = RandomShift(1, i, 2);
    EXPECT_LE(std::max(std::abs(shift.x), std::abs(shift.y)), 2);
  }
}

TEST_F(ClassifyTest, ServesAPerceptualLoss) {
  const Path run = Trained();
  nn::Context context(workers_, nn::DType::kF64);  // whatever the run was trained in
  const auto features = Ok(LoadPerceptualNetwork(context, {.file = run, .first_level = 1}));
  Rng rng(1);
  nn::Tensor numbers = context.Empty({2, 3, 16, 16});
  nn::FillUniform(numbers, rng, 0, 1);
  const nn::Var images = nn::Parameter(context, numbers);
  const auto levels = (*features)(images);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].shape(), (nn::Shape{2, 8, 8, 8}));
  EXPECT_EQ((*features)(images)[0].value().data<double>()[5], levels[0].value().data<double>()[5]);
  const nn::Var loss = FeatureL1Loss(*features, images, context.Zeros({2, 3, 16, 16}));
  EXPECT_GT(loss.item(), 0);
  EXPECT_EQ(nn::Grad(loss, {images})[0].shape(), images.shape());
  EXPECT_TRUE(context.status().ok());
  // More levels left out than there are: the last remains.
  EXPECT_EQ((*LoadPerceptualNetwork(context, {.file = run, .first_level = 9}))(images).size(), 1u);
}

TEST_F(ClassifyTest, PerceptualNetworksThatAreNoneAreNamed) {
  ExpectMessage(LoadPerceptualNetwork(context_, {.kind = "vgg19", .file = "x"}).status(),
                "\"vgg19\"", "\"vgg16\"");
  EXPECT_EQ(LoadPerceptualNetwork(context_, {.file = folder_ / "none"}).status().code(),
            StatusCode::kNotFound);
  ASSERT_TRUE(WriteNoiseDataset(folder_ / "noise").ok());
  Ok(Train({.run = "meshes",
            .config = kTinyConfig,
            .settings = {"schedule.steps=1"},
            .data = "noise"})
         .status());
  ExpectMessage(LoadPerceptualNetwork(context_, {.file = folder_ / "meshes"}).status(), "meshes",
                "\"single_image\"", "\"classify\"");
}

// A user's network by torchvision's names, here a narrow one.
TEST_F(ClassifyTest, PerceptualNetworkFromSafetensors) {
  std::vector<nn::NamedTensor> weights;
  Rng rng(2);
  std::int64_t in = 3;
  for (const int index : {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28}) {
    const std::string name = "features." + std::to_string(index);
    nn::Tensor weight = context_.Empty({4, in, 3, 3});
    nn::FillUniform(weight, rng, -0.1, 0.1);
    weights.push_back({name + ".weight", weight});
    weights.push_back({name + ".bias", context_.Zeros({4})});
    in = 4;
  }
  const Path file = folder_ / "narrow.safetensors";
  ASSERT_TRUE(nn::WriteSafetensors(file, {weights, {}}).ok());
  const auto features = Ok(LoadPerceptualNetwork(context_, {.kind = "vgg16", .file = file}));
  const nn::Var images = nn::Constant(context_, context_.Full({1, 3, 64, 64}, 0.5));
  EXPECT_EQ((*features)(images).size(), 5u);
  EXPECT_TRUE(context_.status().ok());
  weights.pop_back();
  ASSERT_TRUE(nn::WriteSafetensors(file, {weights, {}}).ok());
  ExpectMessage(LoadPerceptualNetwork(context_, {.kind = "vgg16", .file = file}).status(),
                "narrow.safetensors", "features.28.bias");
}

}  // namespace tilegrad::train::classify_test

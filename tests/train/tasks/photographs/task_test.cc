// SPDX-License-Identifier: Apache-2.0
// The task goes the whole way on miniatures of CUB-200 and PASCAL3D+: it trains, predicts, is
// evaluated by Table 3 and reported. Its bits: every_task_test.cc.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "nn/nn.h"
#include "scene/weak_perspective_ref.h"
#include "train/config.h"
#include "train/data/photographs/miniature.h"
#include "train/models/photograph_network.h"
#include "train/run/log.h"
#include "train/same_run.h"
#include "train/tasks/photographs/step.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::photographs_task_test {

class PhotographsTask : public TinyRunTest {
 protected:
  PhotographsTask() { WriteMiniature(folder_ / "cub", "cub"); }

  // The mean shape of 42 vertices loses much of its hull to smoothing.
  Result<RunOutcome> TrainPhotographs(const std::string& run,
                                      const std::vector<std::string>& settings = {},
                                      const std::string& data = "cub") const {
    std::vector<std::string> all = {"network.smoothing=0", "schedule.sample_every=1000"};
    all.insert(all.end(), settings.begin(), settings.end());
    return Train({.run = run, .config = kTinyPhotographs, .settings = all, .data = data});
  }
};

// Of bars of one shape the mean shape is the truth, and no network can do better. Of bars whose
// colour tells their length it can: better than one shape for all, learned with the same losses.
TEST_F(PhotographsTask, LearnsShapesThatTheMeanShapeIsNot) {
  WriteMiniature(folder_ / "bars", "pascal3d", {.train = 40, .test = 10, .stretch = 0.4});
  Score scores[2];
  for (const char* deformation : {"0.3", "1000"}) {
    const bool deforms = deformation[0] == '0';
    const char* run = deforms ? "shapes" : "one_shape";
    Ok(TrainPhotographs(run,
                        {"loss.keypoint=100", "loss.laplacian=1", "loss.mask=20",
                         fmt::format("loss.deformation={}", deformation), "schedule.steps=300",
                         "network.smoothing=2"},
                        "bars")
           .status());
    scores[deforms ? 1 : 0] = Ok(Evaluate(run, "bars"))->rows[2].mean;
  }
  EXPECT_GT(*scores[1].pck, *scores[0].pck + 0.05);
  EXPECT_LT(*scores[1].mask_loss, *scores[0].mask_loss - 0.05);
}

TEST_F(PhotographsTask, TrainsPredictsIsEvaluatedAndReported) {
  for (const char* texture : {"direct", "flow"}) {
    const Path run = folder_ / texture;
    std::vector<std::string> settings = {"loss.mask=2", "schedule.steps=60"};
    if (texture[0] == 'f') settings.push_back("loss.color_moves=false");
    Ok(TrainPhotographs(texture, settings).status());
    const auto log = Ok(ReadLog(run));
    EXPECT_LT(log->back().values[0].second, log->front().values[0].second);
    const auto predictor = Ok(Predictor::Load(run, workers_));
    const auto meshes = Ok(predictor->Predict(std::vector<std::uint8_t>(4 * 16 * 16, 128)));
    EXPECT_EQ((*meshes)[0].textures[0].image.width, 32);
    const auto evaluation = Ok(Evaluate(texture, "cub"));
    ASSERT_EQ(evaluation->rows.size(), 3u);
    const Score& ours = evaluation->rows[2].mean;
    EXPECT_GT(*ours.pck, 0.1);  // of 60 steps; LearnsShapesThatTheMeanShapeIsNot learns longer
    EXPECT_LT(*ours.texture_l1, 0.5);
    // The mean shape starts as the hull of the keypoints, which is in the picture.
    EXPECT_LT(*evaluation->rows[0].mean.mask_loss, 0.9) << FormatTable(*evaluation);
    EXPECT_GT(*evaluation->rows[0].mean.pck, 0.5);
    const std::string table = FormatTable(*evaluation);
    ExpectIn(table, "texture L1", "2D IoU loss", "PCK@0.1", "keypoints within 0.1");
    ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());
    const auto read = ReadEvaluation(run);
    ASSERT_TRUE(read.ok() && read->has_value());
    EXPECT_EQ((*read)->rows[2].mean.pck, ours.pck);

    ExpectIn(Page(texture, "cub", 2), "from one photograph", "10 photographs, one of each object",
             "2D IoU loss", "Cotangent Laplacian", "Held-out photographs", "class (photographs)",
             "1 view of each photograph", "held-out photographs.");
  }
}

// Eight cameras of each photograph, of which the likeliest is told: the one nearest to the truth is
// learned to be it, and learns to be there. Bars are turned by anything about y.
class CameraHeads : public PhotographsTask, public ::testing::WithParamInterface<const char*> {
 protected:
  // Of a loss term, its mean over 50 steps from one on.
  static double MeanOf(const std::vector<LogEntry>& log, const char* term, std::size_t from) {
    double sum = 0;
    for (std::size_t i = from; i < from + 50; ++i) {
      for (const auto& [name, value] : log[i].values) sum += name == term ? value / 50 : 0;
    }
    return sum;
  }
};

TEST_P(CameraHeads, FindTheCameraByAzimuths) {
  Ok(TrainPhotographs("eight", {"network.azimuths=8", std::string("network.rotation=") + GetParam(),
                                "schedule.steps=500"})
         .status());
  const auto log = Ok(ReadLog(folder_ / "eight"));
  ASSERT_EQ(log->size(), 500u);
  EXPECT_NEAR(MeanOf(*log, "azimuth", 0), std::log(8.0), 0.2);  // all alike
  EXPECT_LT(MeanOf(*log, "azimuth", 450), 0.6 * std::log(8.0));
  EXPECT_LT(MeanOf(*log, "camera", 450), MeanOf(*log, "camera", 0));
  const auto scores = Ok(Evaluate("eight", "cub", 24, Split::kTrain));
  EXPECT_EQ(scores->rows.size(), 3u);  // nobody knows where the bars' keypoints truly are
}

INSTANTIATE_TEST_SUITE_P(Rotations, CameraHeads, ::testing::Values("quaternion", "rows"));

TEST(StartingRotations, AreTheNearestToThemselves) {
  for (int k = 0; k < 8; ++k) {
    std::array<double, 4> q = StartingRotation(k, 8);
    EXPECT_EQ(NearestStart(q, 8), k);
    for (double& x : q) x *= -3;  // the same rotation
    EXPECT_EQ(NearestStart(q, 8), k);
  }
  EXPECT_EQ(StartingRotation(0, 1), (std::array<double, 4>{0, 1, 0, 0}));
}

// What is known of the keypoints is a row of its own, which an exact camera makes perfect.
TEST_F(PhotographsTask, TrueKeypointsAreTheCeiling) {
  PhotographSet set = OpenPhotographs(folder_ / "cub").value();
  for (Photograph& photo : set.photographs) {
    photo.points = set.mean_keypoints;
    for (std::size_t k = 0; k < photo.points.size(); ++k) {
      const auto seen = ProjectWeakly(*photo.camera, photo.points[k]);
      photo.keypoints[k] = {seen[0], seen[1], true};
    }
  }
  ASSERT_TRUE(WriteCmrLayout(folder_ / "cub", set).ok());
  Ok(TrainPhotographs("run").status());
  const auto scores = Ok(Evaluate("run", "cub"));
  ASSERT_EQ(scores->rows.size(), 4u);
  EXPECT_EQ(scores->rows[0].method, "true keypoints");
  EXPECT_EQ(scores->rows[0].mean.pck, 1);
  EXPECT_FALSE(scores->rows[0].mean.mask_loss);
  ExpectIn(FormatTable(*scores), "100.0");
}

TEST_F(PhotographsTask, LearnsFromPascal3dAndWithPredictedCameras) {
  WriteMiniature(folder_ / "p3d", "pascal3d");
  Ok(TrainPhotographs("p3d_run", {}, "p3d").status());
  Ok(TrainPhotographs("camera", {"photographs.camera=predicted"}, "p3d").status());
}

TEST_F(PhotographsTask, WhatDoesNotFitIsAnError) {
  ExpectMessage(TrainPhotographs("a", {}, "none").status(), "no such folder");
  ExpectMessage(TrainPhotographs("b", {"loss.none=1"}).status(), "loss.none");
  ExpectMessage(TrainPhotographs("c", {"network.texture=paint"}).status(), "network.texture",
                "paint");
  PhotographsConfig azimuths;
  azimuths.network.azimuths = 4;
  azimuths.camera = "predicted";
  ExpectMessage(CheckConfig(azimuths), "network.azimuths is 4");
  PhotographsConfig rotation;
  rotation.network.rotation = "euler";
  ExpectMessage(CheckConfig(rotation), "network.rotation", "euler");
  Ok(TrainPhotographs("d").status());
  WriteMiniature(folder_ / "cub", "cub", {.train = 8, .test = 5});
  ExpectMessage(TrainPhotographs("d").status(), "other training photographs");
  ExpectMessage(Evaluate("d", "cub").status(), "was trained on");
}

TEST_F(PhotographsTask, PicturesOfTheSameNamesMayBeOthers) {
  const PhotographSet set = OpenPhotographs(folder_ / "cub").value();
  const auto expect_refused = [&](const char* id) {
    ExpectMessage(TrainPhotographs("run").status(), "other training photographs", id);
  };
  Ok(TrainPhotographs("run").status());
  const Bytes picture = ReadFile(set.photographs[1].image).value();
  std::filesystem::copy_file(set.photographs[0].image, set.photographs[1].image,
                             std::filesystem::copy_options::overwrite_existing);
  expect_refused("bar_1.png");
  Ok(WriteFileAtomic(set.photographs[1].image, picture));
  Ok(TrainPhotographs("run").status());
  PhotographSet other = set;
  other.photographs[2].keypoints[0] = {3, 4, true};
  ASSERT_TRUE(WriteCmrLayout(folder_ / "cub/cachedir/cub", other).ok());
  expect_refused("bar_2.png");
  // A list of earlier versions has names alone, and is completed.
  const Path list = folder_ / "run/training_photographs.txt";
  const std::string text = ReadText(list).value();
  Write("run/training_photographs.txt", text.substr(0, text.find("file ")));
  Ok(TrainPhotographs("run").status());
  EXPECT_EQ(ReadText(list).value().size(), text.size());
}

// Gradients of the whole step in float64, by central differences along random directions of all
// weights: through network, projection, renderer and losses.
TEST_F(PhotographsTask, GradientsOfAStep) {
  for (const char* texture : {"direct", "flow"}) {
    PhotographsConfig config;
    config.network = {.code = {.base = 4, .most = 8, .levels = 2, .latent = 8},
                      .texture = texture,
                      .sphere = {.level = 1, .radius = 1, .smoothing = 2}};
    config.size = 16;
    config.render.sharpness = config.render.sharpness_start = 50;
    config.loss.iou = 1;
    config.camera = "predicted";
    config.schedule.steps = 10;
    const PhotographSet set = OpenPhotographs(folder_ / "cub").value();
    const auto store = PhotoStore::Load(set, {0, 1, 2}, {}, 16, workers_, {});
    nn::Context context(workers_, nn::DType::kF64);
    PhotographStep step(context, config, {set.mean_keypoints, 15});
    const PhotographBatch batch = GatherPhotographs(context, config, *store, {0, 1, 2}, 3);
    StepValues values;
    auto parameters = nn::Parameters(step.network().module());
    std::vector<nn::Var> vars;
    for (const auto& p : parameters) vars.push_back(p.value);
    const nn::Var loss = step.Loss(batch, 1, &values);
    const auto gradients = nn::Grad(loss, vars);
    ASSERT_TRUE(context.status().ok()) << context.status().message();
    for (std::size_t which :
         {parameters.size() - 1, parameters.size() - 2, parameters.size() - 4}) {
      nn::Tensor value = parameters[which].value.value();
      const std::vector<double> before(value.span<double>().begin(), value.span<double>().end());
      Rng rng(which);
      std::vector<double> direction(before.size());
      double slope = 0;
      for (std::size_t i = 0; i < before.size(); ++i) {
        direction[i] = rng.Normal();
        slope += direction[i] * gradients[which].value().span<double>()[i];
      }
      const auto at = [&](double h) {
        for (std::size_t i = 0; i < before.size(); ++i)
          value.data<double>()[i] = before[i] + h * direction[i];
        StepValues ignored;
        return step.Loss(batch, 1, &ignored).item();
      };
      // Colours jump where an edge crosses a pixel's centre, so the step is small.
      const double h = 1e-7, difference = (at(h) - at(-h)) / (2 * h);
      at(0);
      EXPECT_NEAR(slope, difference, 2e-3 * (1 + std::abs(difference))) << parameters[which].name;
    }
  }
}

// Section 5.4 with the terms of section 5.3: a second stage starts as another run and has a critic,
// which is kept and logged.
TEST_F(PhotographsTask, ASecondStageHasACritic) {
  const auto train_second = [&] {
    return TrainPhotographs(
               "second", {"start.run=" + (folder_ / "first").string(), "adversarial.weight=0.5",
                          "adversarial.features=1", "adversarial.base=2", "adversarial.halvings=2",
                          "adversarial.learning_rate=1e-3"})
        .status();
  };
  ExpectMessage(train_second(), "first");  // which is not there
  Ok(TrainPhotographs("first").status());
  Ok(train_second());
  nn::Context context(workers_);
  const auto tensors = FinalTensors(context, folder_ / "second", 12);
  EXPECT_TRUE(std::ranges::any_of(
      tensors, [](const nn::NamedTensor& tensor) { return tensor.name.starts_with("critic."); }));
  const auto log = Ok(ReadLog(folder_ / "second"));
  for (const char* name : {"adversarial", "critic_features", "critic_distance", "critic_penalty"}) {
    EXPECT_TRUE(std::ranges::any_of(log->back().values, [&](const auto& value) {
      return value.first == name;
    })) << name;
  }
}

// In float64, by a central difference along a random direction of the texture's last layer: h as
// above.
TEST_F(PhotographsTask, GradientsOfAStepWithACritic) {
  PhotographsConfig config;
  config.network = {.code = {.base = 4, .most = 8, .levels = 2, .latent = 8},
                    .sphere = {.level = 1, .radius = 1, .smoothing = 2}};
  config.adversary = {.weight = 0.5, .features = 1, .base = 2, .halvings = 2};
  config.loss = {.keypoint = 0,
                 .mask = 0,
                 .camera = 0,
                 .deformation = 0,
                 .laplacian = 0,
                 .entropy = 0,
                 .color = 0};
  config.size = 16;
  config.render.sharpness = config.render.sharpness_start = 50;
  config.schedule.steps = 10;
  const PhotographSet set = OpenPhotographs(folder_ / "cub").value();
  const auto store = PhotoStore::Load(set, {0, 1, 2}, {}, 16, workers_, {});
  nn::Context context(workers_, nn::DType::kF64);
  PhotographStep step(context, config, {set.mean_keypoints, 15});
  const auto adversary = Adversary::Make(context, config.adversary, {.seed = 5}).value();
  step.SetAdversary(adversary.get());
  const PhotographBatch batch = GatherPhotographs(context, config, *store, {0, 1, 2}, 3);
  std::vector<nn::Var> vars;
  for (const auto& p : nn::Parameters(step.network().module())) vars.push_back(p.value);
  StepValues values;
  const auto gradients = nn::Grad(step.Loss(batch, 1, &values), vars);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  double largest = 0;
  for (std::size_t which = 0; which < vars.size(); ++which) {
    if (!gradients[which].valid()) continue;
    const std::span<double> value = vars[which].value().span<double>();
    const double slope = gradients[which].value().span<double>()[0], before = value[0];
    const auto at = [&](double h) {
      value[0] = before + h;
      StepValues ignored;
      return step.Loss(batch, 1, &ignored).item();
    };
    const double h = 1e-7, difference = (at(h) - at(-h)) / (2 * h);
    at(0);
    EXPECT_NEAR(slope, difference, 2e-3 * (1 + std::abs(difference))) << which;
    largest = std::max(largest, std::abs(slope));
  }
  EXPECT_GT(largest, 1e-3);  // something depends on the critic
}

// By hand: a regular octahedron reaches 1 along its axes, 1 / sqrt(3) along its diagonals.
TEST(HullReaches, OfAnOctahedron) {
  const std::vector<std::array<double, 3>> points = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                                     {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  EXPECT_NEAR(HullReach(points, {0, 0, 0}, {0, 1, 0}), 1, 1e-9);
  const double d = 1 / std::sqrt(3.0);
  EXPECT_NEAR(HullReach(points, {0, 0, 0}, {d, d, -d}), d, 1e-9);
  EXPECT_EQ(HullReach({{1, 0, 0}, {0, 0, 1}, {-1, 0, -1}}, {0, 0, 0}, {0, 1, 0}), 0);
}

// Shapes are mirror images of themselves, and the mean shape starts as the hull of the keypoints.
TEST(PhotographNetworks, StartAsTheHullAndStaySymmetric) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const auto shape = MiniatureShape(CubMirror());
  PhotographNetwork network(context,
                            {.code = {.base = 4, .most = 8, .levels = 2, .latent = 8},
                             .sphere = {.level = 2, .radius = 1, .smoothing = 2},
                             .output_deviation = 0.5},
                            {shape, 15}, 16, 1);
  const nn::Var mean = network.MeanShape();
  const auto p = mean.value().span<double>();
  double longest = 0;
  for (std::size_t i = 0; i < p.size(); i += 3)
    longest = std::max(longest, std::hypot(p[i], p[i + 1], p[i + 2]));
  EXPECT_GT(longest, 0.5);
  const nn::Var input = nn::Constant(context, context.Full({2, 3, 16, 16}, 0.3));
  const auto out = network.Forward(input, nn::Mode::kTrain);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  double sum = 0, largest = 0;
  const auto q = out.positions.value().span<double>();
  for (std::size_t i = 0; i < q.size(); i += 3) {
    sum += q[i];
    largest = std::max(largest, q[i]);
  }
  EXPECT_NEAR(sum, 0, 1e-9);
  EXPECT_GT(largest, 0.1);
  EXPECT_EQ(out.keypoints.shape(), (nn::Shape{2, 15, 3}));
  EXPECT_EQ(out.cameras.shape(), (nn::Shape{2, 7}));
  // Each keypoint's weights sum to 1.
  const nn::Var weights = network.KeypointWeights();
  const auto w = weights.value().span<double>();
  double first = 0;
  for (std::size_t v = 0; v < w.size() / 15; ++v) first += w[v];
  EXPECT_NEAR(first, 1, 1e-12);
}

// Either kind of head starts with the same cameras.
TEST(PhotographNetworks, RowsStartWhereQuaternionsDo) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  for (const char* rotation : {"quaternion", "rows"}) {
    PhotographNetwork network(context,
                              {.code = {.base = 4, .most = 8, .levels = 2, .latent = 8},
                               .azimuths = 3,
                               .rotation = rotation},
                              {}, 16, 1);
    const nn::Var input = nn::Constant(context, context.Full({1, 3, 16, 16}, 0.0));
    // The code's own weights say a little, as the last layer's do.
    const auto out = network.Forward(input, nn::Mode::kTrain);
    ASSERT_TRUE(context.status().ok()) << context.status().message();
    ASSERT_EQ(out.camera_choices.shape(), (nn::Shape{3, 7}));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto start = StartingRotation(static_cast<int>(k), 3);
      double agree = 0;
      for (std::size_t i = 0; i < 4; ++i)
        agree += out.camera_choices.value().span<double>()[7 * k + 3 + i] * start[i];
      EXPECT_GT(std::abs(agree), 0.9) << rotation << k;
    }
  }
}

}  // namespace tilegrad::train::photographs_task_test

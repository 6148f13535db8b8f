// SPDX-License-Identifier: Apache-2.0
// The network of section 5.1, and the gradient of the whole chain: loss <- renderer <-
// normalisation <- network weights.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/rng.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "scene/topology.h"
#include "support/expect.h"
#include "train/gradient_check.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train::chain_test {

TEST(MeshNetwork, HasThePapersParameters) {
  const Workers workers(1);
  nn::Context context(workers);
  MeshNetwork network(context, NetworkConfig{}, 64, 1);
  EXPECT_EQ(nn::CountParameters(network.module()), kPaperParameters);
  EXPECT_EQ(network.sphere().mesh().positions.size(), 642u);
}

TEST(MeshNetwork, PredictionsFillTheirBox) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const nn::Var x = nn::Constant(
      context, context.From({1, 3, 3}, std::span<const double>({0.0, 0, 0, 4, 1, 0, 2, 1, 1})));
  const nn::Var y = NormalizeMeshes(x, 0.45);
  const std::vector<double> want = {-0.45,   -0.1125, -0.1125, 0.45,  0.1125,
                                    -0.1125, 0,       0.1125,  0.1125};
  for (std::size_t i = 0; i < want.size(); ++i)
    EXPECT_NEAR(y.value().data<double>()[i], want[i], 1e-9);
  const nn::Var point = nn::Parameter(context, context.Full({1, 4, 3}, 2.0));
  const nn::Var collapsed = NormalizeMeshes(point, 0.45);
  const nn::Var gradient = nn::Grad(nn::Sum(collapsed), {point})[0];
  for (const double v : gradient.value().span<double>()) EXPECT_TRUE(std::isfinite(v));
}

// A few weights, offsets large enough to look at.
NetworkConfig TinyNetwork() {
  return {.channels = 2,
          .code = 6,
          .hidden1 = 5,
          .hidden2 = 7,
          .sphere = {.level = 2, .radius = 0.175, .smoothing = 0, .symmetric = false},
          .output_deviation = 1};
}

// The gradient of smoothing is covered by the chain below.
TEST(MeshNetwork, SmoothingSpreadsOffsets) {
  const Workers workers(1);
  nn::Context context(workers);
  const auto roughness = [&](std::int64_t rounds) {
    NetworkConfig config = TinyNetwork();
    config.sphere.smoothing = rounds;
    MeshNetwork network(context, config, 16, 1);
    const nn::Var images = nn::Constant(context, context.Full({2, 4, 16, 16}, 0.5));
    const Prediction out = network.Forward(images, nn::Mode::kEval);
    const auto& mesh = network.sphere().mesh();
    const Topology topology = BuildTopology(mesh.faces, mesh.positions.size());
    double differences = 0, squares = 0;
    const float* const m = out.movement.value().data<float>();
    for (const Edge& edge : topology.edges) {
      for (int c = 0; c < 3; ++c) {
        const double d = m[3 * edge.a + c] - m[3 * edge.b + c];
        differences += d * d;
        squares += m[3 * edge.a + c] * m[3 * edge.a + c];
      }
    }
    return differences / squares;
  };
  // White noise: differences have twice the variance. Four rounds correlate neighbours as a lazy
  // random walk of eight steps spreads, with a variance of 2 squared edges an axis: by exp(-1/4),
  // so 2 (1 - 0.78) = 0.44 is left. With 162 vertices the estimates scatter by some 10 %.
  EXPECT_NEAR(roughness(0), 2, 0.5);
  EXPECT_NEAR(roughness(4), 0.44, 0.15);
}

// Every vertex of a sphere has a partner at (-x, y, z); of a symmetric prediction it is at the
// mirror image of its place, to the rounding of diffusion's sums.
TEST(MeshNetwork, SymmetricPredictionsAre) {
  const Workers workers(1);
  nn::Context context(workers);
  for (const bool fc_norm : {false, true}) {
    NetworkConfig config = TinyNetwork();
    config.sphere.smoothing = 2;
    config.sphere.symmetric = true;
    config.fc_norm = fc_norm;
    MeshNetwork network(context, config, 16, 1);
    const nn::Var images = nn::Constant(context, context.Full({2, 4, 16, 16}, 0.5));
    const Prediction out = network.Forward(images, nn::Mode::kEval);
    const auto& sphere = network.sphere().mesh().positions;
    const float* const p = out.positions.value().data<float>();
    double moved = 0;
    for (std::size_t v = 0; v < sphere.size(); ++v) {
      const glm::vec3 image(-sphere[v].x, sphere[v].y, sphere[v].z);
      const auto partner = std::find(sphere.begin(), sphere.end(), image) - sphere.begin();
      ASSERT_LT(partner, static_cast<std::ptrdiff_t>(sphere.size()));
      const float *const a = p + 3 * v, *const b = p + 3 * partner;
      EXPECT_NEAR(a[0], -b[0], 1e-6);
      EXPECT_NEAR(a[1], b[1], 1e-6);
      EXPECT_NEAR(a[2], b[2], 1e-6);
      moved += std::abs(static_cast<double>(out.movement.value().data<float>()[3 * v]));
    }
    EXPECT_GT(moved, 1);  // and not because nothing moves
  }
}

// Two objects, two views of 16 x 16, a small network: everything of a real step.
struct SmallProblem {
  SingleImageConfig config;
  ImageStore store;
  std::vector<Sample> samples = {{0, {0, 1}}, {1, {2, 0}, true}, {0, {2, 1}}};

  SmallProblem() {
    config.network = TinyNetwork();
    config.network.sphere.level = 1;
    config.network.sphere.smoothing = 2;
    config.network.fc_deviation = 0;
    config.network.color_bias = 0.4;
    config.network.output_deviation = NetworkConfig().output_deviation;
    config.render = {.sharpness = 60, .sharpness_start = 60, .max_alpha_error = 0};
    config.batch = 3;
    store.models = 2;
    store.views = 3;
    store.size = 16;
    CameraRule rule;
    rule.lens.width = rule.lens.height = store.size;
    Rng rng(5);
    store.bytes.Resize(store.ImageBytes() * 6);
    for (int v = 0; v < 3; ++v)
      store.cameras.push_back(OrbitCamera(rule.lens, 40.0 * v, 20, rule.distance));
    // Truth: discs with noise inside.
    for (std::size_t image = 0; image < 6; ++image) {
      for (int i = 0; i < 256; ++i) {
        const double x = i % 16 - 7.5, y = i / 16 - 7.5;
        const bool inside = x * x + y * y < 20 + 6.0 * static_cast<double>(image);
        for (std::size_t c = 0; c < 4; ++c) {
          store.bytes[image * store.ImageBytes() + c * 256 + static_cast<std::size_t>(i)] =
              static_cast<std::uint8_t>(!inside  ? 0
                                        : c == 3 ? 255
                                                 : 60 + rng.Below(150));
        }
      }
    }
  }
};

// A whole step.
Result<StepValues> RunStep(TrainStep& step, const BatchTensors& batch, std::int64_t number) {
  StepValues values;
  const nn::Var loss = step.Loss(batch, number, &values);
  TILEGRAD_ASSIGN(const auto gradients, step.weights().Gradients(loss, nullptr, values));
  TILEGRAD_TRY(step.weights().Update(gradients, number));
  return values;
}

// On weights of every layer; gradients of single weights are 1e-4 and more. The chain is piecewise
// smooth (ReLU, visibility, L1, the box): one entry in fifty may sit on a kink.
void ExpectGradientsAgreeWithDifferences(const SmallProblem& p) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  TrainStep step(context, p.config, p.store.size);
  const BatchTensors batch = GatherBatch(context, p.store, p.samples);
  StepValues values;
  const auto parameters = step.weights().adam().parameters();
  const auto gradients = nn::Grad(step.Loss(batch, 0, &values), parameters);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  EXPECT_LT(TermOf(values, "iou"), 0.95);  // the scene is not empty: silhouettes overlap
  const auto loss = [&] {
    StepValues moved;
    step.Loss(batch, 0, &moved);
    return moved.loss;
  };
  Rng rng(9);
  const Differences d = CompareWithDifferences({parameters.begin(), parameters.end()}, loss,
                                               gradients, 3, 1e-8, rng, 1e-5);
  EXPECT_LE(d.off, d.checked / 50) << "of " << d.checked;
}

TEST(Chain, Float64GradientsAgreeWithDifferences) {
  ExpectGradientsAgreeWithDifferences(SmallProblem());
}

TEST(Chain, SoDoThoseOfSymmetricShapesAndLayersWithoutNorm) {
  SmallProblem p;
  p.config.network.sphere.symmetric = true;
  p.config.network.fc_norm = false;
  ExpectGradientsAgreeWithDifferences(p);
}

TEST(Chain, SoDoThoseOfColorsLookedUpInThePicture) {
  SmallProblem p;
  p.config.network.picture_colors = true;
  ExpectGradientsAgreeWithDifferences(p);
}

TEST(Chain, SoDoThoseOfN3mrsVertices) {
  SmallProblem p;
  p.config.network.sphere.n3mr_vertices = true;
  p.config.network.sphere.smoothing = 0;
  ExpectGradientsAgreeWithDifferences(p);
}

// SoftRas has a derivative once its product has no floor; N3MR's sweep is none.
TEST(Chain, SoDoThoseThroughSoftRas) {
  SmallProblem p;
  p.config.render.rule = "softras";
  p.config.rivals.softras.sigma = 3e-3;
  p.config.rivals.softras.exact_product = true;
  ExpectGradientsAgreeWithDifferences(p);
  p.config.rivals.softras_color = p.config.rivals.softras_colors.position_gradient = true;
  p.config.rivals.softras_colors.gamma = 1e-2;
  ExpectGradientsAgreeWithDifferences(p);
}

// The path that trains (float32, SIMD, tiled renderer) against float64: a relative error of the
// whole gradient of each tensor. Float rounding 6e-8 grows by the sums' condition and batch norm's
// division; 1e-3 of the tensor's norm is asked.
TEST(Chain, TheTrainingPathAgreesWithFloat64) {
  const SmallProblem p;
  const Workers workers(2);
  nn::Context wide(workers, nn::DType::kF64), narrow(workers);
  TrainStep reference(wide, p.config, p.store.size), fast(narrow, p.config, p.store.size);
  ASSERT_TRUE(nn::LoadState(reference.network().module(), nn::State(fast.network().module())).ok());
  StepValues want, got;
  const auto d_want = nn::Grad(reference.Loss(GatherBatch(wide, p.store, p.samples), 0, &want),
                               reference.weights().adam().parameters());
  const auto d_got = nn::Grad(fast.Loss(GatherBatch(narrow, p.store, p.samples), 0, &got),
                              fast.weights().adam().parameters());
  EXPECT_NEAR(got.loss, want.loss, 1e-5);
  EXPECT_NEAR(TermOf(got, "iou"), TermOf(want, "iou"), 1e-5);
  EXPECT_NEAR(TermOf(got, "color"), TermOf(want, "color"), 1e-5);
  double total = 0;
  for (const nn::Var& d : d_want) {
    for (const double g : d.value().span<double>()) total += g * g;
  }
  for (std::size_t i = 0; i < d_want.size(); ++i) {
    double difference = 0, norm = 0;
    for (std::size_t k = 0; k < d_want[i].value().elements(); ++k) {
      const double w = d_want[i].value().data<double>()[k], g = d_got[i].value().data<float>()[k];
      difference += (w - g) * (w - g);
      norm += w * w;
    }
    // Biases before batch norm have gradient 0 but for rounding: their floor is a share of the
    // whole.
    EXPECT_LE(std::sqrt(difference), 1e-3 * std::sqrt(norm) + 1e-6 * std::sqrt(total)) << i;
  }
}

void ExpectSameBitsAndLearning(const std::string& rule, bool color = false) {
  SmallProblem p;
  p.config.rivals.softras_color = p.config.rivals.n3mr_color = color;
  std::vector<std::vector<float>> finals;
  double first = 0, last = 0;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    nn::Context context(workers);
    SingleImageConfig config = p.config;
    config.optimizer.learning_rate = 3e-3;
    config.render.rule = rule;
    TrainStep step(context, config, p.store.size);
    for (std::int64_t s = 0; s < 60; ++s) {
      const auto values = Ok(RunStep(step, GatherBatch(context, p.store, p.samples), s));
      (s == 0 ? first : last) = values->loss;
    }
    std::vector<float> weights;
    for (const nn::NamedTensor& t : nn::State(step.network().module())) {
      const auto span = t.value.span<float>();
      weights.insert(weights.end(), span.begin(), span.end());
    }
    finals.push_back(std::move(weights));
  }
  EXPECT_EQ(finals[0], finals[1]);
  EXPECT_EQ(finals[0], finals[2]);
  EXPECT_LT(last, 0.7 * first);  // three pictures can be learned by heart
}

TEST(Chain, SameBitsForAnyWorkerCountAndTrainingLearns) { ExpectSameBitsAndLearning("dibr"); }
TEST(Chain, SoDoesSoftRas) { ExpectSameBitsAndLearning("softras"); }
TEST(Chain, SoDoesSoftRasWithColors) { ExpectSameBitsAndLearning("softras", true); }
TEST(Chain, SoDoesN3mr) { ExpectSameBitsAndLearning("n3mr"); }
TEST(Chain, SoDoesN3mrWithColors) { ExpectSameBitsAndLearning("n3mr", true); }

// Alpha alone: no colour in the loss, and none of its decoder's weights moves.
TEST(Chain, RivalsHaveNoColorLoss) {
  SmallProblem p;
  const Workers workers(1);
  for (const char* rule : {"softras", "n3mr"}) {
    nn::Context context(workers);
    p.config.render.rule = rule;
    TrainStep step(context, p.config, p.store.size);
    StepValues values;
    const nn::Var loss = step.Loss(GatherBatch(context, p.store, p.samples), 0, &values);
    const LossConfig& w = p.config.loss;
    EXPECT_NEAR(values.loss,
                w.iou * TermOf(values, "iou") + w.smoothness * TermOf(values, "smoothness") +
                    w.laplacian * TermOf(values, "laplacian"),
                1e-6);
    EXPECT_EQ(values.terms.size(), 3u);
    const auto parameters = nn::Parameters(step.network().module());
    const auto gradients = nn::Grad(loss, step.weights().adam().parameters());
    double moving = 0;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      double largest = 0;
      for (const float g : gradients[i].value().span<float>())
        largest = std::max(largest, std::abs(static_cast<double>(g)));
      if (parameters[i].name.starts_with("color")) {
        EXPECT_EQ(largest, 0) << parameters[i].name;
      } else {
        moving += largest > 0 ? 1 : 0;
      }
    }
    EXPECT_GT(moving, 10);
  }
}

// One weight of infinity, whatever layer it is in.
TEST(Chain, WhatIsNotFiniteIsRefusedBeforeAnythingChanges) {
  const SmallProblem p;
  const Workers workers(2);
  nn::Context context(workers);
  TrainStep step(context, p.config, p.store.size);
  const BatchTensors batch = GatherBatch(context, p.store, p.samples);
  ASSERT_TRUE(RunStep(step, batch, 0).ok());
  const auto bits = [&] {  // of weights and moments
    std::vector<nn::NamedTensor> all = step.weights().adam().State();
    for (const nn::NamedVar& weight : nn::Parameters(step.network().module())) {
      all.push_back({weight.name, weight.value.value()});
    }
    return nn::EncodeSafetensors({all, {}}).value();
  };
  const Bytes before = bits();
  for (nn::NamedVar& parameter : nn::Parameters(step.network().module())) {
    float& weight = *parameter.value.value().data<float>();
    const float finite = std::exchange(weight, std::numeric_limits<float>::infinity());
    EXPECT_FALSE(RunStep(step, batch, 1).ok()) << parameter.name;
    weight = finite;
    EXPECT_EQ(bits(), before) << parameter.name;
  }
}

TEST(Schedules, LearningRateAndSharpness) {
  SingleImageConfig c;
  c.schedule.steps = 100;
  c.optimizer = {.learning_rate = 1, .final_factor = 0.1, .warmup = 10, .settle = 0};
  EXPECT_NEAR(LearningRateAt(c.optimizer, 100, 0), 0.1, 1e-9);
  EXPECT_NEAR(LearningRateAt(c.optimizer, 100, 50), 0.55, 1e-12);
  EXPECT_NEAR(LearningRateAt(c.optimizer, 100, 99), 0.1, 3e-4);  // 0.45 (1 + cos(0.99 pi)) above
  c.optimizer.settle = 50;
  EXPECT_GT(LearningRateAt(c.optimizer, 20000, 19949), 0.1);
  EXPECT_EQ(LearningRateAt(c.optimizer, 20000, 19950), 0);
  EXPECT_GT(LearningRateAt(c.optimizer, 199, 197), 0.1);
  EXPECT_EQ(LearningRateAt(c.optimizer, 199, 198), 0);
  EXPECT_GT(LearningRateAt(c.optimizer, 99, 98), 0.1);
  c.rivals.softras.sigma = 1e-4;
  c.rivals.softras_late_sigma = 0.3;
  EXPECT_EQ(SoftRasSigmaAt(c.rivals, 0.59), 1e-4);
  EXPECT_NEAR(SoftRasSigmaAt(c.rivals, 0.6), 3e-5, 1e-18);
  c.render.sharpness_start = 100;
  c.render.sharpness = 10000;
  EXPECT_NEAR(SharpnessAt(c.render, 100, 0), 100, 1e-9);
  EXPECT_NEAR(SharpnessAt(c.render, 100, 25), 1000, 1e-9);
  EXPECT_NEAR(SharpnessAt(c.render, 100, 80), 10000, 1e-8);
}

TEST(SingleImageConfig, N3mrVerticesHaveNoOffsets) {
  SingleImageConfig config;
  config.network.sphere.n3mr_vertices = true;
  EXPECT_TRUE(CheckConfig(config).ok());
  config.network.sphere.symmetric = true;
  ExpectMessage(CheckConfig(config), "network.n3mr_vertices has no offsets");
}

TEST(RivalConfig, UnknownWordsNameTheKnownOnes) {
  const auto message = [](const std::string& rule, const RivalConfig& config) {
    return RivalOptions(rule, config).status().message();
  };
  EXPECT_EQ(message("nmr", {}),
            "render.rule is \"nmr\", but must be one of \"dibr\", \"softras\", \"n3mr\"");
  EXPECT_EQ(message("dibr", {.softras_distance = "l2"}),
            "softras.distance is \"l2\", but must be one of \"euclidean\", \"barycentric\", "
            "\"hard\"");
  EXPECT_EQ(message("dibr", {.softras_alpha = "max"}),
            "softras.alpha is \"max\", but must be one of \"product\", \"sum\", \"hard\"");
  EXPECT_EQ(message("n3mr", {.n3mr_reduction = "box"}),
            "n3mr.reduction is \"box\", but must be one of \"mean\", \"bilinear\", \"none\"");
  EXPECT_EQ(message("n3mr", {.n3mr = {.near_plane = 7, .far_plane = 7}}),
            "N3MR: near 7 and far 7 must be 0 < near < far");
  EXPECT_FALSE(RivalOptions("dibr", {}).value().has_value());
  EXPECT_EQ(RivalOptions("n3mr", {.n3mr_reduction = "bilinear"}).value()->n3mr.reduction,
            rivals::N3mrReduction::kBilinear);
}

}  // namespace tilegrad::train::chain_test

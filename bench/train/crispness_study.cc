// SPDX-License-Identifier: Apache-2.0
// How crisp predicted textures are, with and without the adversarial terms of section 5.3: of each
// run of task.kind = "textured_image", on held-out models, pictures of the predicted texture beside
// those of the true one.
//
//   crispness_study datasets/cars runs/classify runs/textured runs/adversarial ...
//
// The second argument is a network of task.kind = "classify" whose features the Frechet distance is
// of; it should not be the one of a perceptual loss.
#include <fmt/core.h>

#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "nn/nn.h"
#include "train/metrics/metrics.h"
#include "train/metrics/set_scores.h"
#include "train/predictor.h"
#include "train/tasks/classify/perceptual_network.h"
#include "train/tasks/textured_image/held_out_views.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {
namespace {

constexpr int kViews = 16;

struct Pictures {
  std::vector<std::vector<float>> predicted, truth;  // [4][size][size] each, textures alone
};

struct Data {
  const Workers& workers;
  const Dataset& dataset;
  const FeatureFunction& features;
  nn::Context& context;
  int size() const { return dataset.info().image_size; }
};

Result<Pictures> Draw(const Data& data, TexturedModel& model) {
  const TexturedImageConfig& config = model.config();
  TILEGRAD_ASSIGN(HeldOutViews held_out,
                  HeldOutViews::Load({config, data.dataset, data.dataset.Select(Split::kTest)},
                                     data.workers, {}));
  ObjectPictures pictures(config.light, data.size(), static_cast<int>(config.stream.draw.samples));
  Pictures out;
  for (std::size_t i = 0; i < held_out.models().size(); ++i) {
    TILEGRAD_ASSIGN(const auto truth, held_out.Draw(i, kViews));
    TILEGRAD_ASSIGN(const auto objects, model.PredictObjects(ToBytes(truth.lit)));
    for (std::size_t v = 0; v < objects.size(); ++v) {
      TILEGRAD_ASSIGN(auto drawn,
                      pictures.Draw(objects[v].mesh, truth.views[v], Appearance::kTexture));
      out.predicted.push_back(std::move(drawn));
      const auto shown = truth.Of(truth.texture, v);
      out.truth.emplace_back(shown.begin(), shown.end());
    }
  }
  return out;
}

// Where both cover a pixel wholly.
std::vector<std::uint8_t> Both(std::span<const float> a, std::span<const float> b) {
  const std::size_t pixels = a.size() / 4;
  std::vector<std::uint8_t> out;
  for (std::size_t i = 3 * pixels; i < a.size(); ++i) out.push_back(a[i] > 0.999f && b[i] > 0.999f);
  return out;
}

// The mean of each channel of the deepest layer.
Result<FeatureRows> FeaturesOf(const Data& data, const std::vector<std::vector<float>>& pictures) {
  const nn::NoGrad off(data.context);
  FeatureRows rows;
  for (const std::vector<float>& rgba : pictures) {
    const std::span<const float> rgb = std::span(rgba).first(rgba.size() / 4 * 3);
    const auto levels = data.features(
        nn::Constant(data.context, data.context.From({1, 3, data.size(), data.size()}, rgb)));
    TILEGRAD_TRY(data.context.TakeStatus());
    const nn::Shape& shape = levels.back().shape();
    const nn::Var mean = nn::Mean(nn::Reshape(levels.back(), {shape[1], -1}), {1});
    const auto values = std::as_const(mean).value().span<float>();
    rows.width = values.size();
    rows.values.insert(rows.values.end(), values.begin(), values.end());
  }
  return rows;
}

Status Score(const Data& data, const Path& run) {
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(run, data.workers));
  auto* model = predictor.model().textured();
  if (model == nullptr)
    return InvalidArgument("{}: not of task.kind = \"textured_image\"", run.string());
  TILEGRAD_TRY(predictor.CheckImageSize(data.dataset));
  TILEGRAD_ASSIGN(const Pictures pictures, Draw(data, *model));
  double energy = 0, true_energy = 0, l1 = 0;
  for (std::size_t i = 0; i < pictures.truth.size(); ++i) {
    const auto &a = pictures.predicted[i], &b = pictures.truth[i];
    const std::size_t numbers = a.size() / 4 * 3;
    const std::vector<std::uint8_t> both = Both(a, b);
    const auto planes = [&](const std::vector<float>& p) {
      return PlanarPicture{std::span(p).first(numbers), 3, data.size(), data.size()};
    };
    TILEGRAD_ASSIGN(const double of_a, HighPassEnergy(planes(a), both));
    TILEGRAD_ASSIGN(const double of_b, HighPassEnergy(planes(b), both));
    energy += of_a;
    true_energy += of_b;
    for (std::size_t k = 0; k < numbers; ++k)
      l1 += std::abs(static_cast<double>(a[k]) - static_cast<double>(b[k])) /
            static_cast<double>(numbers * pictures.truth.size());
  }
  TILEGRAD_ASSIGN(const FeatureRows predicted, FeaturesOf(data, pictures.predicted));
  TILEGRAD_ASSIGN(const FeatureRows truth, FeaturesOf(data, pictures.truth));
  const std::size_t half = truth.rows() / 2;
  TILEGRAD_ASSIGN(const double frechet,
                  FrechetDistance(DrawRows(predicted, half, 1), DrawRows(truth, half, 1)));
  const FeatureRows shuffled = DrawRows(truth, 2 * half, 2);
  TILEGRAD_ASSIGN(const double floor, FrechetDistance(SliceRows(shuffled, 0, half),
                                                      SliceRows(shuffled, half, 2 * half)));
  fmt::print("| {} | {:.4f} | {:.2f} | {:.3f} | {:.3f} |\n", run.filename().string(), l1,
             energy / true_energy, frechet, floor);
  return {};
}

Status Run(std::span<char*> arguments) {
  const Workers workers;
  nn::Context context(workers);
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(arguments[0]));
  TILEGRAD_ASSIGN(const FeatureFunction features,
                  LoadPerceptualNetwork(context, {.file = arguments[1]}));
  fmt::print(
      "| run | texture L1 | high-pass energy / truth's | Frechet distance | its floor |\n"
      "| --- | --: | --: | --: | --: |\n");
  const Data data{workers, dataset, features, context};
  for (char* run : arguments.subspan(2)) TILEGRAD_TRY(Score(data, run));
  return {};
}

}  // namespace
}  // namespace tilegrad::train

int main(int argc, char** argv) {
  if (argc < 4) {
    fmt::print(stderr, "usage: {} DATASET RUN_OF_A_CLASSIFIER RUN...\n", argv[0]);
    return EXIT_FAILURE;
  }
  const auto status = tilegrad::train::Run(std::span(argv + 1, static_cast<std::size_t>(argc) - 1));
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "{}\n", status.message());
  return EXIT_FAILURE;
}

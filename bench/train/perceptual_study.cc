// SPDX-License-Identifier: Apache-2.0
// Whether a perceptual loss sees as people do: of each held-out picture of a dataset, moved by one
// pixel to the right and down, or blurred by a Gaussian of 1.2 pixels, which is farther from the
// picture itself? People hardly notice the shift.
//
//   perceptual_study runs/classify furniture
#include <fmt/core.h>

#include <cmath>
#include <cstdlib>

#include "nn/nn.h"
#include "train/models/classifier.h"
#include "train/tasks/classify/model.h"
#include "train/tasks/classify/perceptual_network.h"

namespace tilegrad::train {
namespace {

constexpr double kSigma = 1.2;
constexpr int kReach = 4, kViews = 8;
constexpr std::size_t kBatch = 32;

std::vector<double> GaussianWeights() {
  std::vector<double> out;
  double sum = 0;
  for (int i = -kReach; i <= kReach; ++i)
    sum += out.emplace_back(std::exp(-i * i / (2 * kSigma * kSigma)));
  for (double& w : out) w /= sum;
  return out;
}

// Along one axis: [outer][size][inner], black beyond the edge.
void BlurAxis(std::span<float> values, std::size_t size, std::size_t inner) {
  const std::vector<double> weights = GaussianWeights();
  const std::vector<float> before(values.begin(), values.end());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto at = static_cast<std::ptrdiff_t>(i / inner % size);
    double sum = 0;
    for (int k = -kReach; k <= kReach; ++k) {
      if (at + k < 0 || at + k >= static_cast<std::ptrdiff_t>(size)) continue;
      sum += weights[static_cast<std::size_t>(k + kReach)] *
             before[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(i) +
                                             k * static_cast<std::ptrdiff_t>(inner))];
    }
    values[i] = static_cast<float>(sum);
  }
}

struct Pictures {
  nn::Var plain, shifted, blurred;  // [n, 3, size, size]
};

Pictures Prepare(nn::Context& context, const LabelledImages& data, std::span<const Sample> some) {
  const std::vector<Shift> shifts(some.size(), {1, 1});
  const nn::Tensor plain = GatherLabelled(context, data, some).images;
  nn::Tensor blurred = context.Copy(plain);
  const auto size = static_cast<std::size_t>(data.images.size);
  BlurAxis(blurred.span<float>(), size, 1);
  BlurAxis(blurred.span<float>(), size, size);
  return {nn::Constant(context, plain),
          nn::Constant(context, GatherLabelled(context, data, some, shifts).images),
          nn::Constant(context, blurred)};
}

// For each layer and picture: how much farther the shift is than the blur, each as a mean over the
// layer's elements.
std::vector<std::vector<double>> Excess(const FeatureFunction& features, const Pictures& p) {
  const auto a = features(p.plain), b = features(p.shifted), c = features(p.blurred);
  std::vector<std::vector<double>> out;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto distance = [&](const nn::Var& other) {
      return nn::Mean(nn::Reshape(nn::Abs(other - a[i]), {a[i].shape()[0], -1}), {1});
    };
    const auto excess = (distance(b[i]) - distance(c[i])).value();
    out.emplace_back(excess.span<float>().begin(), excess.span<float>().end());
  }
  return out;
}

class Tally {
 public:
  void Add(const std::vector<std::vector<double>>& layers) {
    single_.resize(layers.size());
    from_.resize(layers.size());
    pictures_ += layers[0].size();
    for (std::size_t p = 0; p < layers[0].size(); ++p) {
      double sum = 0;
      for (std::size_t i = layers.size(); i-- > 0;) {
        sum += layers[i][p];
        single_[i] += layers[i][p] > 0;
        from_[i] += sum > 0;
      }
    }
  }
  void Print(const char* name) const {
    fmt::print("{}: the shift is called worse, % of {} pictures\n", name, pictures_);
    for (std::size_t i = 0; i < single_.size(); ++i) {
      fmt::print("  level {} alone {:5.1f}   levels from {} on {:5.1f}\n", i, Percent(single_[i]),
                 i, Percent(from_[i]));
    }
  }

 private:
  double Percent(std::size_t count) const {
    return 100.0 * static_cast<double>(count) / static_cast<double>(pictures_);
  }
  std::size_t pictures_ = 0;
  std::vector<std::size_t> single_, from_;  // by layer
};

Status Study(const char* name, nn::Context& context, const LabelledImages& data,
             const FeatureFunction& features) {
  const nn::NoGrad off(context);
  Tally tally;
  std::vector<Sample> some;
  const int views = std::min(kViews, data.images.views), all = data.images.models * views;
  for (int i = 0; i < all; ++i) {
    some.push_back({i / views, {i % views * data.images.views / views}});
    if (some.size() < kBatch && i + 1 < all) continue;
    tally.Add(Excess(features, Prepare(context, data, some)));
    some.clear();
  }
  TILEGRAD_TRY(context.TakeStatus());
  tally.Print(name);
  return {};
}

Status Run(const Path& run, const Path& folder) {
  const Workers workers;
  nn::Context context(workers);
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  TILEGRAD_ASSIGN(const LabelledImages data,
                  LoadLabelled(dataset, dataset.Select(Split::kTest), workers, {}));
  TILEGRAD_TRY(
      Study("plain L1", context, data, [](const nn::Var& x) { return std::vector<nn::Var>{x}; }));
  TILEGRAD_ASSIGN(const FeatureFunction trained,
                  LoadPerceptualNetwork(context, {.file = run, .first_level = 0}));
  TILEGRAD_TRY(Study("trained classifier", context, data, trained));
  ClassifierNetwork untrained(context, {}, 2, /*seed=*/1);
  return Study("the same network with random weights", context, data,
               [&](const nn::Var& x) { return untrained.Levels(x, nn::Mode::kTrain); });
}

}  // namespace
}  // namespace tilegrad::train

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: {} RUN_OF_A_CLASSIFIER DATASET\n", argv[0]);
    return EXIT_FAILURE;
  }
  const tilegrad::Status status = tilegrad::train::Run(argv[1], argv[2]);
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "{}\n", status.message());
  return EXIT_FAILURE;
}

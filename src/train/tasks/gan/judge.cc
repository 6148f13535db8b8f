// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/judge.h"

#include <algorithm>

#include "nn/nn.h"
#include "train/tasks/classify/perceptual_network.h"
#include "train/tasks/gan/watch.h"

namespace tilegrad::train {
namespace {

constexpr std::int64_t kJudgedAtOnce = 16;  // objects
constexpr std::int64_t kColorCells = 4;     // to a plane: Frechet distances of wide rows take long
constexpr double kLeastDeviation = 0.05;
constexpr int kFirstLevel = 3;  // of the classifier: what lies before compares little but pixels

}  // namespace

std::vector<std::uint8_t> VariedColumns(const FeatureRows& truth) {
  std::vector<std::uint8_t> out(truth.width);
  const auto n = static_cast<double>(truth.rows());
  for (std::size_t c = 0; c < truth.width; ++c) {
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < truth.rows(); ++i) {
      const double x = truth.Row(i)[c];
      sum += x;
      squares += x * x;
    }
    out[c] = squares / n - (sum / n) * (sum / n) > kLeastDeviation * kLeastDeviation;
  }
  return out;
}

FeatureRows Only(FeatureRows rows, const std::vector<std::uint8_t>& columns) {
  for (std::size_t i = 0; i < rows.values.size(); ++i) {
    if (columns[i % rows.width] == 0) rows.values[i] = 0;
  }
  return rows;
}

Result<Judge> Judge::Make(nn::Context& context, const Path& run) {
  Judge out(context);
  if (run.empty()) return out;
  TILEGRAD_ASSIGN(out.network_, LoadPerceptualNetwork(context, {"classify", run, kFirstLevel}));
  return out;
}

std::string Judge::name() const {
  return network_ ? "the levels of a classifier"
                  : "mean and deviation of colours in 4 x 4 cells of each view";
}

Result<FeatureRows> Judge::Pictures(const ObjectViews& set) const {
  if (network_) return Levels(set);
  return ColorFeatures(set, kColorCells);
}

Result<FeatureRows> Judge::Levels(const ObjectViews& set) const {
  const nn::NoGrad off(context_);
  const nn::Shape& shape = set.colors.shape();
  FeatureRows out;
  const nn::Var all = nn::Constant(context_, set.colors);
  for (std::int64_t i = 0; i < shape[0]; i += kJudgedAtOnce) {
    const std::int64_t end = std::min(shape[0], i + kJudgedAtOnce);
    const nn::Var some = nn::Reshape(nn::Slice(all, 0, i, end), {-1, 3, shape[2], shape[3]});
    std::vector<nn::Var> means;
    for (const nn::Var& level : network_(some)) means.push_back(nn::Mean(level, {2, 3}));
    const nn::Var rows = nn::Reshape(nn::Concat(means, 1), {end - i, shape[1] / 3, -1});
    const nn::Var mean = nn::Mean(rows, {1});  // over the views
    TILEGRAD_TRY(context_.TakeStatus());
    out.width = static_cast<std::size_t>(mean.shape()[1]);
    const auto numbers = mean.value().span<float>();
    out.values.insert(out.values.end(), numbers.begin(), numbers.end());
  }
  return out;
}

}  // namespace tilegrad::train

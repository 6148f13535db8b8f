// SPDX-License-Identifier: Apache-2.0
// Trains a small classifier of furniture: the class of a model from one of its renders. The models
// it is scored on were not seen in training.
//
//   tilegrad dataset --source sweethome3d --out furniture
//   classify_example furniture
//
// Train() below is the whole of the learning; the rest reads images and scores.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "nn/nn.h"
#include "train/data/batches.h"

namespace tilegrad {
namespace {

using namespace tilegrad::nn;

struct Data {
  train::ImageStore images;
  std::vector<std::int32_t> labels;  // of each model
};

Result<Data> Load(const train::Dataset& dataset, train::Split split, const Workers& workers) {
  const std::vector<int> models = dataset.Select(split);
  Data data;
  TILEGRAD_ASSIGN(data.images, train::LoadImageStore(dataset, models, workers, {}));
  for (const int m : models) {
    data.labels.push_back(dataset.models()[static_cast<std::size_t>(m)].class_index);
  }
  return data;
}

struct Batch {
  Var images;     // [n, 4, size, size], RGBA in [0, 1]
  Tensor labels;  // [n]
};

Batch Gather(Context& context, const Data& data, const std::vector<train::Sample>& samples) {
  const std::int64_t size = data.images.size, n = static_cast<std::int64_t>(samples.size());
  Tensor images = context.Empty({n, 4, size, size});
  std::vector<std::int32_t> labels;
  float* to = images.data<float>();
  for (const train::Sample& sample : samples) {
    const auto bytes = data.images.Image(sample.model, sample.views[0]);
    to = std::transform(bytes.begin(), bytes.end(), to,
                        [](std::uint8_t b) { return static_cast<float>(b) / 255.0f; });
    labels.push_back(data.labels[static_cast<std::size_t>(sample.model)]);
  }
  return {Constant(context, images), context.Indices(labels)};
}

// Mirrored or not, and moved by up to four pixels: the whole batch alike.
Var Varied(const Var& images, Rng& rng) {
  const std::int64_t size = images.shape()[3];
  std::vector<std::int32_t> columns(static_cast<std::size_t>(size));
  std::iota(columns.begin(), columns.end(), 0);
  if (rng.Below(2) == 0) std::reverse(columns.begin(), columns.end());
  const auto x = static_cast<std::int64_t>(rng.Below(9)),
             y = static_cast<std::int64_t>(rng.Below(9));
  const Var wide = PadImage(images, Padding::All(4), PadMode::kZero);
  const Var moved = Slice(Slice(wide, 2, y, y + size), 3, x, x + size);
  return Gather(moved, 3, images.context().Indices(columns));
}

Result<double> Train(Context& context, Module& net, const Data& data, std::int64_t steps) {
  Adam adam(context, Parameters(net), {.learning_rate = 2e-3, .weight_decay = 1e-2});
  train::BatchOrder order(data.images.models, data.images.views, /*seed=*/1);
  Rng rng(2);
  double smoothed = 0;
  for (std::int64_t step = 0; step < steps; ++step) {
    const Batch batch = Gather(context, data, order.Batch(step, 64, 1));
    const Var scores = net.Forward(Varied(batch.images, rng), Mode::kTrain);
    const Var loss = CrossEntropy(scores, batch.labels);
    adam.options().learning_rate = WarmedUp(CosineRate(2e-3, {steps, 0.01}, step), 20, step);
    TILEGRAD_TRY(adam.Step(Gradients(loss, adam.parameters())));
    smoothed = step == 0 ? loss.item() : 0.95 * smoothed + 0.05 * loss.item();
  }
  return smoothed;
}

void Build(Context& context, Sequential& net, std::int64_t image_size, std::int64_t classes) {
  Rng rng(1);
  std::int64_t in = 4;
  for (const std::int64_t out : {24, 48, 96}) {
    const std::string name = std::to_string(out);
    const ConvShape half{in, out, /*kernel=*/5, {.stride = 2, .padding = 2}, /*bias=*/false};
    net.Add<Conv2dLayer>("conv" + name, context, half, rng);
    net.Add<BatchNorm>("norm" + name, context, out, BatchNormOptions{.relu = true});
    in = out;
  }
  net.Add<Flatten>("flatten");
  const std::int64_t side = image_size / 8;
  net.Add<LinearLayer>("fc", context, LinearShape{.in = in * side * side, .out = classes}, rng);
}

// Every view of every model, in batches of at most 256.
std::vector<std::vector<train::Sample>> AllViews(const Data& data) {
  std::vector<std::vector<train::Sample>> batches;
  for (int i = 0; i < data.images.models * data.images.views; ++i) {
    if (i % 256 == 0) batches.emplace_back();
    batches.back().push_back({i / data.images.views, {i % data.images.views}});
  }
  return batches;
}

double Share(std::int64_t right, const Data& data) {
  return 100.0 * static_cast<double>(right) / (data.images.models * data.images.views);
}

double NetworkAccuracy(Context& context, Module& net, const Data& data) {
  const NoGrad off(context);
  std::int64_t right = 0;
  for (const auto& samples : AllViews(data)) {
    const Batch batch = Gather(context, data, samples);
    const Var scores = net.Forward(batch.images, Mode::kEval);
    const auto classes = static_cast<std::size_t>(scores.shape()[1]);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const float* row = scores.value().data<float>() + i * classes;
      right += std::max_element(row, row + classes) - row == batch.labels.data<std::int32_t>()[i];
    }
  }
  return Share(right, data);
}

// Always the class that is most frequent in training.
double ChanceAccuracy(const Data& train, const Data& test) {
  std::vector<int> counts(256);
  for (const std::int32_t label : train.labels) ++counts[static_cast<std::size_t>(label)];
  const auto most = std::max_element(counts.begin(), counts.end()) - counts.begin();
  return Share(test.images.views * std::count(test.labels.begin(), test.labels.end(), most), test);
}

// The class of the training image whose pixels are nearest: the smallest |b|^2 - 2 a.b over b.
double NeighbourAccuracy(Context& context, const Data& train, const Data& test) {
  const NoGrad off(context);
  std::int64_t right = 0;
  for (const auto& samples : AllViews(test)) {
    const Batch batch = Gather(context, test, samples);
    const Var a = Reshape(batch.images, {batch.images.shape()[0], -1});
    std::vector<float> nearest(samples.size(), std::numeric_limits<float>::infinity());
    std::vector<std::int32_t> label(samples.size());
    for (const auto& others : AllViews(train)) {
      const Batch known = Gather(context, train, others);
      const Var b = Reshape(known.images, {known.images.shape()[0], -1});
      const Var distance = Sum(Square(b), {1}) - 2.0 * Matmul(a, b, {false, true});
      for (std::size_t i = 0; i < distance.value().elements(); ++i) {
        const std::size_t image = i / others.size();
        if (!(distance.value().data<float>()[i] < nearest[image])) continue;
        nearest[image] = distance.value().data<float>()[i];
        label[image] = known.labels.data<std::int32_t>()[i % others.size()];
      }
    }
    for (std::size_t i = 0; i < samples.size(); ++i) {
      right += label[i] == batch.labels.data<std::int32_t>()[i];
    }
  }
  return Share(right, test);
}

Status Run(const Path& folder, std::int64_t steps) {
  const Workers workers;
  TILEGRAD_ASSIGN(const train::Dataset dataset, train::Dataset::Open(folder));
  TILEGRAD_ASSIGN(const Data train, Load(dataset, train::Split::kTrain, workers));
  TILEGRAD_ASSIGN(const Data test, Load(dataset, train::Split::kTest, workers));
  const auto classes = static_cast<std::int64_t>(dataset.info().classes.size());
  if (train.labels.empty() || test.labels.empty() || dataset.info().image_size % 8 != 0) {
    return {StatusCode::kInvalidArgument, "needs training and test models, sides a multiple of 8"};
  }
  Context context(workers);
  Sequential net;
  Build(context, net, train.images.size, classes);
  const auto start = std::chrono::steady_clock::now();
  TILEGRAD_ASSIGN(const double loss, Train(context, net, train, steps));
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
  fmt::print("{} classes, {} training models, {} held out, {} views each\n", classes,
             train.images.models, test.images.models, test.images.views);
  fmt::print("{} parameters, {} steps in {:.1f} s, last loss {:.3f}\n", CountParameters(net), steps,
             time.count(), loss);
  fmt::print("held-out accuracy, one image:\n  chance             {:5.1f} %\n",
             ChanceAccuracy(train, test));
  fmt::print("  nearest neighbour  {:5.1f} %\n", NeighbourAccuracy(context, train, test));
  fmt::print("  network            {:5.1f} %\n", NetworkAccuracy(context, net, test));
  return context.TakeStatus();
}

}  // namespace
}  // namespace tilegrad

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: classify_example DATASET [STEPS = 400]\n");
    return 2;
  }
  const tilegrad::Status status = tilegrad::Run(argv[1], argc > 2 ? std::atoll(argv[2]) : 400);
  if (!status.ok()) fmt::print(stderr, "classify_example: {}\n", status.message());
  return status.ok() ? 0 : 1;
}

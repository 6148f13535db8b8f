// SPDX-License-Identifier: Apache-2.0
// A training step of the network of the paper's section 5.1 (34.1 million parameters, batch 64),
// its loss replaced by a mean of squares, beside what bounds it: the multiplications, and the
// memory that Adam moves.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "nn/kernels/adam.h"
#include "nn/kernels/batch_norm.h"
#include "nn/nn.h"

namespace tilegrad::nn {
namespace {

constexpr std::int64_t kBatch = 64, kImage = 64, kOutputs = 642 * 3;

// Layer after layer with batch norm and ReLU but after the last.
void AddDense(Sequential& net, Context& context, std::vector<std::int64_t> widths, Rng& rng) {
  for (std::size_t i = 1; i < widths.size(); ++i) {
    const std::string number = std::to_string(i);
    net.Add<LinearLayer>("fc" + number, context, LinearShape{widths[i - 1], widths[i]}, rng);
    if (i + 1 == widths.size()) break;
    net.Add<BatchNorm>("bn" + number, context, widths[i], BatchNormOptions{.relu = true});
  }
}

struct Network {
  explicit Network(Context& context) {
    Rng rng(1);
    const std::int64_t channels[] = {4, 64, 128, 256};
    for (std::size_t i = 0; i < 3; ++i) {
      const ConvShape conv{channels[i], channels[i + 1], 5, {.stride = 2, .padding = 2}};
      encoder.Add<Conv2dLayer>("conv" + std::to_string(i), context, conv, rng);
      encoder.Add<BatchNorm>("bn" + std::to_string(i), context, channels[i + 1],
                             BatchNormOptions{.relu = true});
    }
    encoder.Add<Flatten>("flatten");
    AddDense(encoder, context, {16384, 1024, 1024, 1024}, rng);
    AddDense(shape, context, {1024, 1024, 2048, kOutputs}, rng);
    AddDense(colour, context, {1024, 1024, 2048, kOutputs}, rng);
  }

  std::vector<NamedVar> All() {
    std::vector<NamedVar> all = Parameters(encoder);
    for (Module* module : {&shape, &colour}) {
      const auto more = Parameters(*module);
      all.insert(all.end(), more.begin(), more.end());
    }
    return all;
  }

  Var Loss(const Var& image) {
    const Var code = encoder.Forward(image, Mode::kTrain);
    return Mean(Square(shape.Forward(code, Mode::kTrain))) +
           Mean(Square(colour.Forward(code, Mode::kTrain)));
  }

  Sequential encoder, shape, colour;
};

void TrainingStep(benchmark::State& state) {
  const Workers workers(static_cast<int>(state.range(0)));
  Context context(workers);
  Network net(context);
  Adam adam(context, net.All(), {.learning_rate = 1e-4});
  Rng rng(2);
  Tensor image = context.Empty({kBatch, 4, kImage, kImage});
  FillUniform(image, rng, 0, 1);
  const Var x = Constant(context, image);
  const auto step = [&] {
    const auto gradients = Grad(net.Loss(x), adam.parameters());
    if (!adam.Step(gradients).ok()) state.SkipWithError("the step failed");
  };
  step();
  const std::size_t misses = context.memory().stats().misses;
  for (auto _ : state) step();
  const MemoryStats stats = context.memory().stats();
  state.counters["pool_misses"] = static_cast<double>(stats.misses - misses);
  state.counters["peak_MB"] = static_cast<double>(stats.peak_bytes) * 1e-6;
  state.counters["images/s"] = benchmark::Counter(static_cast<double>(kBatch * state.iterations()),
                                                  benchmark::Counter::kIsRate);
}
BENCHMARK(TrainingStep)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

// Forward or backward alone would hide what the tape costs; this is the step without Adam.
void ForwardBackward(benchmark::State& state) {
  const Workers workers(1);
  Context context(workers);
  Network net(context);
  std::vector<Var> parameters;
  for (const NamedVar& p : net.All()) parameters.push_back(p.value);
  const Var x = Constant(context, context.Full({kBatch, 4, kImage, kImage}, 0.5));
  for (auto _ : state) {
    const auto gradients = Grad(net.Loss(x), parameters);
    benchmark::DoNotOptimize(gradients.data());
  }
}
BENCHMARK(ForwardBackward)->Unit(benchmark::kMillisecond);

constexpr std::size_t kMany = 34115916;

void AdamPass(benchmark::State& state) {
  const Workers workers(static_cast<int>(state.range(0)));
  std::vector<float> p(kMany, 1), g(kMany, 1e-3f), m(kMany), v(kMany);
  const AdamCoefficients coefficients{.step = 1e-4};
  for (auto _ : state) {
    AdamStep({kMany, p.data(), g.data(), m.data(), v.data(), coefficients}, workers);
  }
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(7 * kMany * sizeof(float)));
}
BENCHMARK(AdamPass)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

// The limit: read four arrays, write three, and compute nothing.
void MemoryPass(benchmark::State& state) {
  std::vector<float> p(kMany, 1), g(kMany, 1e-3f), m(kMany), v(kMany);
  for (auto _ : state) {
    for (std::size_t i = 0; i < kMany; ++i) {
      const float d = g[i];
      p[i] += d;
      m[i] += d;
      v[i] += d;
    }
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(7 * kMany * sizeof(float)));
}
BENCHMARK(MemoryPass)->Unit(benchmark::kMillisecond);

void BatchNormPass(benchmark::State& state) {
  const Workers workers(1);
  const BatchNormShape shape{64, 64, 1024};
  std::vector<float> x(shape.size(), 0.5f), y(shape.size()), one(64, 1), mean(64), variance(64);
  x[0] = 1;
  const BatchNormParameters<float> parameters{one.data(), one.data(), 1e-5, true};
  for (auto _ : state) {
    BatchNormForward({shape, parameters, x.data(), y.data(), mean.data(), variance.data()},
                     workers);
  }
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(2 * shape.size() * sizeof(float)));
}
BENCHMARK(BatchNormPass)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tilegrad::nn

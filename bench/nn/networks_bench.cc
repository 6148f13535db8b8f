// SPDX-License-Identifier: Apache-2.0
// Training steps of the larger networks: a U-Net on images of 256 x 256, and the critic of a WGAN
// with gradient penalty on images of 64 x 64. "GFLOP" counts the convolutions' multiplications and
// additions alone: forward once, backward twice (U-Net); three forward passes, one inner gradient
// and the backward pass through both (critic).
#include <benchmark/benchmark.h>

#include "nn/nn.h"

namespace tilegrad::nn {
namespace {

Var RandomImages(Context& context, const Shape& shape, std::uint64_t seed) {
  Rng rng(seed);
  Tensor images = context.Empty(shape);
  FillUniform(images, rng, 0, 1);
  return Constant(context, images);
}

// Times steps of Adam along the gradient of loss(); the first one, which takes the memory, is not
// counted.
template <class Loss>
void Train(benchmark::State& state, Context& context, Module& net, const Loss& loss) {
  Adam adam(context, Parameters(net), {.learning_rate = 1e-4});
  const auto step = [&] {
    if (!adam.Step(Grad(loss(), adam.parameters())).ok()) state.SkipWithError("the step failed");
  };
  step();
  const std::size_t misses = context.memory().stats().misses;
  for (auto _ : state) step();
  const MemoryStats stats = context.memory().stats();
  state.counters["pool_misses"] = static_cast<double>(stats.misses - misses);
  state.counters["peak_MB"] = static_cast<double>(stats.peak_bytes) * 1e-6;
}

// 31 million parameters, batch 4: 1155 GFLOP.
void UNetStep(benchmark::State& state) {
  const Workers workers(static_cast<int>(state.range(0)));
  Context context(workers);
  Rng rng(1);
  ConvUNet net(context, {}, rng);
  const Var x = RandomImages(context, {4, 3, 256, 256}, 2);
  Train(state, context, net, [&] { return Mean(Abs(net.Forward(x, Mode::kTrain) - x)); });
}
BENCHMARK(UNetStep)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(1);

// Channels 64 to 512, batch 32: 66 GFLOP.
void CriticStep(benchmark::State& state) {
  const Workers workers(static_cast<int>(state.range(0)));
  Context context(workers);
  Rng rng(1);
  Critic net(context, {}, rng);
  const Shape shape = {32, 3, 64, 64};
  const Var real = RandomImages(context, shape, 2), fake = RandomImages(context, shape, 3);
  Train(state, context, net, [&] {
    return Mean(net.Forward(fake, Mode::kTrain)) - Mean(net.Forward(real, Mode::kTrain)) +
           10.0 * GradientPenalty(net, 0.5 * real + 0.5 * fake);
  });
}
BENCHMARK(CriticStep)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace tilegrad::nn

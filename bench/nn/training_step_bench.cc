// SPDX-License-Identifier: Apache-2.0
// Training steps, and beside the first one what bounds it besides its multiplications: the memory
// that Adam and batch norm move.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <vector>

#include "nn/kernels/adam.h"
#include "nn/kernels/batch_norm.h"
#include "training_steps.h"

namespace tilegrad::nn::bench {
namespace {

// The first step, which takes the memory, is not counted.
void RunSteps(benchmark::State& state, std::string_view name) {
  const Workers workers(static_cast<int>(state.range(0)));
  Context context(workers);
  const auto step = MakeTrainingStep(name, context);
  const auto run = [&] {
    if (!step->Run().ok()) state.SkipWithError("the step failed");
  };
  run();
  const std::size_t misses = context.memory().stats().misses;
  for (auto _ : state) run();
  const MemoryStats stats = context.memory().stats();
  state.counters["pool_misses"] = static_cast<double>(stats.misses - misses);
  state.counters["peak_MB"] = static_cast<double>(stats.peak_bytes) * 1e-6;
}

const bool kRegistered = [] {
  for (const std::string_view name : kTrainingSteps) {
    auto* step =
        benchmark::RegisterBenchmark(("TrainingStep/" + std::string(name)).c_str(),
                                     [name](benchmark::State& state) { RunSteps(state, name); });
    step->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
  }
  return true;
}();

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
}  // namespace tilegrad::nn::bench

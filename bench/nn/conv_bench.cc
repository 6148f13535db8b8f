// SPDX-License-Identifier: Apache-2.0
// The convolutions of the image encoder of paper section 5.1 at batch 64, against the FMA peak of
// one core. Columns: peak: GFLOP/s of the core; ours: % of it, medians of CPU-time rates.
// Operations are counted as if the padding were data, as is usual.
#include <benchmark/benchmark.h>

#include <vector>

#include "base/aligned.h"
#include "base/rng.h"
#include "fma_peak.h"
#include "nn/kernels/conv2d.h"

namespace tilegrad::nn {
namespace {

struct Tensors {
  explicit Tensors(const Conv2dShape& s)
      : x(s.in_size()), weight(s.weight_size()), y(s.out_size()) {
    Rng rng(1);
    for (auto* tensor : {&x, &weight, &y}) {
      for (float& v : *tensor) v = static_cast<float>(rng.Uniform(-1, 1));
    }
  }
  AlignedVector<float> x, weight, y;
};

enum Pass { kForward, kInputGrad, kWeightGrad };

Conv2dShape ShapeOf(const benchmark::State& state) {
  const auto arg = [&](int i) { return static_cast<std::size_t>(state.range(i)); };
  Conv2dShape s;
  s.batch = arg(1), s.in_channels = arg(2), s.out_channels = arg(3);
  s.in_height = s.in_width = arg(4);
  s.kernel_height = s.kernel_width = arg(5);
  s.stride = arg(6);
  s.padding = s.kernel_width / 2;
  return s;
}

void RunPass(Pass pass, const Conv2dShape& s, Tensors& t, const KernelContext& context) {
  if (pass == kForward) {
    Conv2dForward(s, t.x.data(), t.weight.data(), nullptr, t.y.data(), context);
  } else if (pass == kInputGrad) {
    Conv2dInputGrad(s, t.y.data(), t.weight.data(), t.x.data(), context);
  } else {
    Conv2dWeightGrad(s, t.x.data(), t.y.data(), t.weight.data(), context);
  }
}

void BM_Conv2d(benchmark::State& state) {
  const Conv2dShape s = ShapeOf(state);
  const auto pass = static_cast<Pass>(state.range(0));
  Tensors tensors(s);
  const double flop = 2.0 * static_cast<double>(s.out_size()) *
                      static_cast<double>(s.in_channels * s.kernel_area());
  const Workers workers(1);
  KernelScratch scratch;
  RunPass(pass, s, tensors, {workers, scratch});
  Samples peak, ours;
  for (auto _ : state) {
    peak.Add(PeakRate());
    ours.Add(Rate(ThreadSeconds, flop, [&] { RunPass(pass, s, tensors, {workers, scratch}); }));
  }
  state.counters["peak"] = peak.Median() * 1e-9;
  state.counters["ours"] = 100 * ours.Median() / peak.Median();
  state.counters["scratch_MB"] = static_cast<double>(scratch.bytes()) * 1e-6;
}

// Wall time of one worker over that of two.
void BM_Conv2dTwoWorkers(benchmark::State& state) {
  const Conv2dShape s = ShapeOf(state);
  const auto pass = static_cast<Pass>(state.range(0));
  Tensors tensors(s);
  const Workers one(1), two(2);
  KernelScratch scratch;
  RunPass(pass, s, tensors, {two, scratch});
  Samples rate_one, rate_two;
  for (auto _ : state) {
    rate_one.Add(Rate(WallSeconds, 1, [&] { RunPass(pass, s, tensors, {one, scratch}); }));
    rate_two.Add(Rate(WallSeconds, 1, [&] { RunPass(pass, s, tensors, {two, scratch}); }));
  }
  state.counters["speedup"] = rate_two.Median() / rate_one.Median();
}

void Shapes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"pass", "n", "c", "o", "h", "k", "s"})->Unit(benchmark::kMillisecond)->MinTime(0.5);
  for (std::int64_t pass : {kForward, kInputGrad, kWeightGrad}) {
    b->Args({pass, 64, 4, 64, 64, 5, 2});
    b->Args({pass, 64, 64, 128, 32, 5, 2});
    b->Args({pass, 64, 128, 256, 16, 5, 2});
    b->Args({pass, 8, 64, 64, 64, 3, 1});
  }
}

BENCHMARK(BM_Conv2d)->Apply(Shapes);
BENCHMARK(BM_Conv2dTwoWorkers)->Apply(Shapes)->UseRealTime();

}  // namespace
}  // namespace tilegrad::nn

// SPDX-License-Identifier: Apache-2.0
// Convolutions of the image encoder of paper section 5.1 at batch 64, and of the U-Net, against the
// FMA peak of one core and oneDNN, in one process, taking turns. Operations are counted as if the
// padding were data, as is usual. "ours" is what the library does by itself: Winograd's algorithm
// where it applies, so that more than 100 % of the peak is possible; "direct" is without it.
#include <vector>

#include "base/aligned.h"
#include "base/rng.h"
#include "nn/kernels/conv2d/conv2d.h"
#include "peers.h"
#include "turns.h"

namespace tilegrad::nn::bench {
namespace {

Conv2dShape ShapeOf(const benchmark::State& state) {
  const auto arg = [&](std::size_t i) { return static_cast<std::size_t>(state.range(i)); };
  Conv2dShape s;
  s.batch = arg(1);
  s.in_channels = arg(2);
  s.out_channels = arg(3);
  s.in_height = s.in_width = arg(4);
  s.kernel_height = s.kernel_width = arg(5);
  s.stride = arg(6);
  s.padding = (s.kernel_width - 1) / 2;
  return s;
}

struct Setup {
  explicit Setup(const benchmark::State& state)
      : pass(static_cast<ConvPass>(state.range(0))),
        s(ShapeOf(state)),
        x(s.in_size()),
        weight(s.weight_size()),
        y(s.out_size()) {
    Rng rng(1);
    for (auto* tensor : {&x, &weight, &y}) {
      for (float& v : *tensor) v = static_cast<float>(rng.Uniform(-1, 1));
    }
  }
  double flop() const {
    return 2.0 * static_cast<double>(s.out_size()) *
           static_cast<double>(s.in_channels * s.kernel_area());
  }
  void Run(const KernelContext& context) {
    if (pass == ConvPass::kForward) {
      Conv2dForward(s, x.data(), weight.data(), nullptr, y.data(), context);
    } else if (pass == ConvPass::kInputGrad) {
      Conv2dInputGrad(s, y.data(), weight.data(), x.data(), context);
    } else {
      Conv2dWeightGrad(s, x.data(), y.data(), weight.data(), context);
    }
  }
  ConvPass pass;
  Conv2dShape s;
  AlignedVector<float> x, weight, y;
};

void BM_Conv2d(benchmark::State& state) {
  Setup setup(state);
  const Workers workers(1);
  KernelScratch scratch;
  std::vector<Contender> contenders{{"ours",
                                     [&] {
                                       setup.Run({workers, scratch});
                                     }},
                                    {"direct", [&] {
                                       setup.Run({workers, scratch, false});
                                     }}};
  OneDnnConv onednn(setup.s, setup.pass);
  if (OneDnnConv::available()) contenders.push_back({"onednn", [&] { onednn.Run(); }});
  MeasureRates(state, setup.flop(), contenders);
  state.counters["scratch_MB"] = static_cast<double>(scratch.bytes()) * 1e-6;
}

void BM_Conv2dTwoWorkers(benchmark::State& state) {
  Setup setup(state);
  MeasureSpeedup(state, [&](const KernelContext& context) { setup.Run(context); });
}

void Shapes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"pass", "n", "c", "o", "h", "k", "s"})->Unit(benchmark::kMillisecond)->MinTime(2);
  for (std::int64_t pass : {0, 1, 2}) {
    b->Args({pass, 64, 4, 64, 64, 5, 2});  // the encoder
    b->Args({pass, 64, 64, 128, 32, 5, 2});
    b->Args({pass, 64, 128, 256, 16, 5, 2});
    b->Args({pass, 8, 64, 64, 64, 3, 1});  // the U-Net
    b->Args({pass, 4, 128, 128, 64, 3, 1});
    b->Args({pass, 4, 512, 512, 16, 3, 1});
    b->Args({pass, 4, 64, 3, 128, 1, 1});
    b->Args({pass, 32, 64, 128, 16, 4, 2});  // a critic
  }
}

BENCHMARK(BM_Conv2d)->Apply(Shapes);
BENCHMARK(BM_Conv2dTwoWorkers)->Apply(Shapes)->MinTime(0.5)->UseRealTime();

}  // namespace
}  // namespace tilegrad::nn::bench

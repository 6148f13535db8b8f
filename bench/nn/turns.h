// SPDX-License-Identifier: Apache-2.0
// Contenders that take turns within one process, so that whatever else the machine does disturbs
// all of them alike; what is reported are medians.
#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <string>
#include <vector>

#include "fma_peak.h"
#include "nn/kernels/kernel_context.h"

namespace tilegrad::nn::bench {

struct Contender {
  std::string name;
  std::function<void()> run;
};

// Counters: peak: GFLOP/s that one core reaches; `name`: the contender's rate in % of it. By CPU
// time of this thread; `flop` is what one run has to do.
inline void MeasureRates(benchmark::State& state, double flop,
                         const std::vector<Contender>& contenders) {
  Samples peak;
  std::vector<Samples> rates(contenders.size());
  for (const Contender& contender : contenders) contender.run();  // takes its memory
  for (auto _ : state) {
    peak.Add(PeakRate());
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      rates[i].Add(Rate(ThreadSeconds, flop, contenders[i].run));
    }
  }
  state.counters["peak"] = peak.Median() * 1e-9;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    state.counters[contenders[i].name] = 100 * rates[i].Median() / peak.Median();
  }
}

// What a kernel gains by a second worker, in wall time. Counters: speedup: one worker over two;
// pinned: one worker over two that stay on their cores.
inline void MeasureSpeedup(benchmark::State& state,
                           const std::function<void(const KernelContext&)>& run) {
  const Workers one(1), two(2), pinned(2, Pinning::kOn);
  KernelScratch scratch;
  Samples rate_one, rate_two, rate_pinned;
  run({two, scratch});
  const auto rate = [&](const Workers& workers) {
    return Rate(WallSeconds, 1, [&] { run({workers, scratch}); });
  };
  for (auto _ : state) {
    rate_one.Add(rate(one));
    rate_two.Add(rate(two));
    rate_pinned.Add(rate(pinned));
  }
  state.counters["speedup"] = rate_two.Median() / rate_one.Median();
  state.counters["pinned"] = rate_pinned.Median() / rate_one.Median();
}

}  // namespace tilegrad::nn::bench

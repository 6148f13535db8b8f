// SPDX-License-Identifier: Apache-2.0
// Contenders that take turns within one process, so that whatever else the machine does disturbs
// all of them alike; what is reported are medians.
#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <string>
#include <vector>

#include "fma_peak.h"

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

// Counter: wall time of `one` over that of `two`.
inline void MeasureSpeedup(benchmark::State& state, const std::function<void()>& one,
                           const std::function<void()>& two) {
  Samples rate_one, rate_two;
  two();
  for (auto _ : state) {
    rate_one.Add(Rate(WallSeconds, 1, one));
    rate_two.Add(Rate(WallSeconds, 1, two));
  }
  state.counters["speedup"] = rate_two.Median() / rate_one.Median();
}

}  // namespace tilegrad::nn::bench

// SPDX-License-Identifier: Apache-2.0
// Contenders that take turns within one process, so that whatever else the machine does disturbs
// all of them alike; what is reported are medians.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
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

// How much of the core this thread has, by RunFullCore. On a machine whose host others use, the
// other hardware thread of a core may be anybody's, for milliseconds to seconds at a time.
class CoreProbe {
 public:
  CoreProbe() {
    for (int i = 0; i < 100; ++i) Measure();
  }
  double Measure() {
    const double rate = RateOf(RunFullCore);
    rates_.Add(rate);
    // Not by the best one seen: where a hypervisor takes time away, it may be taken from the
    // thread's account once too often.
    if (rates_.size() % 50 == 0) least_alone_ = 0.95 * rates_.Quantile(0.99);
    return rate;
  }
  // Tries for some 30 ms to have it alone; returns the last measurement.
  double WaitUntilAlone() {
    double rate = Measure();
    for (int i = 0; i < 90 && rate < least_alone_; ++i) rate = Measure();
    return rate;
  }
  double least_alone() const { return least_alone_; }

 private:
  Samples rates_;
  double least_alone_ = 0;
};

// What a contender did in one turn, and how much of the core it had before or after, the lesser.
struct Turn {
  double rate, core;
};

// Counters: peak: GFLOP/s that one core reaches; `name`: the contender's rate in % of it, median of
// all turns; `name`_alone: median of those in which it had the core for itself, as far as the probe
// before and after it tells; absent if there was none; alone: how many % of all turns those are.
// A turn waits a little for the core. By CPU time of this thread; `flop` is what one run has to do.
inline void MeasureRates(benchmark::State& state, double flop,
                         const std::vector<Contender>& contenders) {
  static CoreProbe core;  // of the process: its best is known the better the longer it runs
  Samples peak;
  std::vector<std::vector<Turn>> turns(contenders.size());
  for (const Contender& contender : contenders) contender.run();  // takes its memory
  for (auto _ : state) {
    peak.Add(RateOf(RunFmaPeak));
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const double before = core.WaitUntilAlone();
      const double rate = Rate(ThreadSeconds, flop, contenders[i].run);
      turns[i].push_back({rate, std::min(before, core.Measure())});
    }
  }
  state.counters["peak"] = peak.Median() * 1e-9;
  double alone_runs = 0;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    Samples all, alone;
    for (const Turn& turn : turns[i]) {
      all.Add(turn.rate);
      if (turn.core >= core.least_alone()) alone.Add(turn.rate);
    }
    const std::string& name = contenders[i].name;
    state.counters[name] = 100 * all.Median() / peak.Median();
    if (alone.size() > 0) state.counters[name + "_alone"] = 100 * alone.Median() / peak.Median();
    alone_runs += static_cast<double>(alone.size()) / static_cast<double>(all.size());
  }
  state.counters["alone"] = 100 * alone_runs / static_cast<double>(contenders.size());
}

// What a kernel gains by a second worker, in wall time. Counter: speedup: one worker over two.
inline void MeasureSpeedup(benchmark::State& state,
                           const std::function<void(const KernelContext&)>& run) {
  const Workers one(1), two(2);
  KernelScratch scratch;
  Samples rate_one, rate_two;
  run({two, scratch});
  const auto rate = [&](const Workers& workers) {
    return Rate(WallSeconds, 1, [&] { run({workers, scratch}); });
  };
  for (auto _ : state) {
    rate_one.Add(rate(one));
    rate_two.Add(rate(two));
  }
  state.counters["speedup"] = rate_two.Median() / rate_one.Median();
}

}  // namespace tilegrad::nn::bench

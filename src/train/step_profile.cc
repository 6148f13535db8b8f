// SPDX-License-Identifier: Apache-2.0
#include "train/step_profile.h"

#include <algorithm>
#include <deque>
#include <limits>

#include "base/clocks.h"
#include "base/error.h"

namespace tilegrad::train {
namespace {

constexpr int kWarmUp = 3;  // steps, after which memory has its size

// A training on some workers.
class Measured {
 public:
  explicit Measured(int workers) : workers_(workers) {}
  // Recorded, as if with that many.
  Measured(int workers, LoopMachine machine)
      : workers_(workers, &trace_), machine_(machine), recorded_(true) {}

  Status Start(const TrainJob& job, const Watch& watch) {
    TILEGRAD_ASSIGN(rehearsal_, Rehearse(job, workers_, watch));
    return {};
  }
  Status Step(bool counts) {
    trace_.Begin();
    const auto begin = std::chrono::steady_clock::now();
    const double before = ThreadSeconds();
    TILEGRAD_TRY(rehearsal_->Step());
    // Processor time for a single worker, as in the records.
    const double seconds = workers_.count() == 1 ? ThreadSeconds() - before : SecondsSince(begin);
    if (!counts) return {};
    seconds_ = std::min(seconds_, seconds);
    if (!recorded_) return {};
    LoopForecast forecast = Forecast(trace_.End(), machine_);
    if (forecast_.places.empty() || forecast.seconds < forecast_.seconds)
      forecast_ = std::move(forecast);
    return {};
  }

  // Of the fastest step.
  double seconds() const { return seconds_; }
  const LoopForecast& forecast() const { return forecast_; }

 private:
  LoopTrace trace_;
  Workers workers_;
  LoopMachine machine_;
  bool recorded_ = false;
  std::unique_ptr<Rehearsal> rehearsal_;
  double seconds_ = std::numeric_limits<double>::infinity();
  LoopForecast forecast_;
};

LoopMachine MachineOf(int workers, const ProfileRequest& request, const StepProfile& here) {
  LoopMachine machine{workers,
                      request.start_seconds > 0 ? request.start_seconds : here.costs.start_seconds};
  const double each = here.costs.bytes_per_second / here.cores;
  machine.bytes_per_second = each * workers;
  if (request.bytes_per_second > 0 && workers > here.cores)
    machine.bytes_per_second = request.bytes_per_second;
  return machine;
}

Status StartAll(std::deque<Measured>* all, const TrainJob& job, const Watch& watch) {
  for (Measured& one : *all) TILEGRAD_TRY(one.Start(job, watch));
  return {};
}

}  // namespace

Result<StepProfile> ProfileSteps(const TrainJob& job, const ProfileRequest& request,
                                 const Watch& watch) {
  StepProfile out;
  out.cores = AvailableCores();
  out.costs = MeasureLoopCosts(Workers(out.cores));
  std::deque<Measured> all;
  all.emplace_back(1);
  all.emplace_back(out.cores);
  for (const int workers : request.workers)
    all.emplace_back(workers, MachineOf(workers, request, out));
  TILEGRAD_TRY(StartAll(&all, job, watch));
  const int steps = kWarmUp + request.steps;
  for (int step = 0; step < steps; ++step) {
    for (Measured& one : all) {
      if (watch.stopped())
        return Cancelled("stopped at step {} of {}; nothing was written", step, steps);
      TILEGRAD_TRY(one.Step(step >= kWarmUp).Within(fmt::format("step {}", step)));
    }
    watch.Report(
        {"profiling", static_cast<std::uint64_t>(step + 1), static_cast<std::uint64_t>(steps), ""});
  }
  out.one = all[0].seconds();
  out.all = all[1].seconds();
  for (std::size_t i = 2; i < all.size(); ++i) out.forecasts.push_back(all[i].forecast());
  return out;
}

}  // namespace tilegrad::train

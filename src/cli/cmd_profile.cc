// SPDX-License-Identifier: Apache-2.0
// tilegrad profile: what a training step would take on machines of many cores, and what holds it
// back there.
#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "train/step_profile.h"

namespace tilegrad::cli {
namespace {

constexpr std::size_t kPlaces = 10;
constexpr double kMostWorkers = 1024;

struct ProfileOptions {
  std::string config, data;
  std::vector<std::string> overrides;
  std::vector<double> workers = {2, 16, 64};
  int steps = 12;
  double bandwidth = 0, start = 0;
};

double Milliseconds(double seconds) { return 1e3 * seconds; }

void PrintMeasured(const train::StepProfile& profile) {
  Print("measured: {:.2f} ms a step on 1 worker, {:.2f} ms on {} ({:.2f} times as fast)\n",
        Milliseconds(profile.one), Milliseconds(profile.all), profile.cores,
        profile.one / profile.all);
  Print("a second worker takes part in a loop after {:.1f} us; {} workers move {:.1f} GB/s\n",
        1e6 * profile.costs.start_seconds, profile.cores, 1e-9 * profile.costs.bytes_per_second);
}

void PrintForecast(int workers, const LoopForecast& forecast, double one) {
  Print(
      "\npredicted: {:.2f} ms a step on {} workers ({:.2f} times as fast); most time is wasted "
      "by\n",
      Milliseconds(forecast.seconds), workers, one / forecast.seconds);
  Print("  wasted ms  takes ms   times  loop, or what stands between two loops\n");
  for (std::size_t i = 0; i < std::min(kPlaces, forecast.places.size()); ++i) {
    const HeldBack& place = forecast.places[i];
    Print("  {:9.3f} {:9.3f} {:7}  {}\n", Milliseconds(place.wasted), Milliseconds(place.taken),
          place.times, place.place);
  }
}

nlohmann::ordered_json ToJson(int workers, const LoopForecast& forecast) {
  nlohmann::ordered_json out = {{"workers", workers}, {"seconds", forecast.seconds}};
  for (const HeldBack& place : forecast.places) {
    out["places"].push_back({{"place", place.place},
                             {"times", place.times},
                             {"work", place.work},
                             {"seconds", place.taken},
                             {"wasted", place.wasted}});
  }
  return out;
}

Status RunProfile(const ProfileOptions& options) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::FindConfig(options.config));
  TILEGRAD_TRY(train::ApplyOverrides(options.overrides, &job.config));
  job.data = options.data;
  ProgressLine line;
  job.warn = line.Warnings();
  train::ProfileRequest request{.steps = options.steps,
                                .bytes_per_second = 1e9 * options.bandwidth,
                                .start_seconds = 1e-6 * options.start};
  for (const double workers : options.workers) request.workers.push_back(static_cast<int>(workers));
  TILEGRAD_ASSIGN(const train::StepProfile profile,
                  train::ProfileSteps(job, request, line.Watching()));
  line.Finish();
  PrintMeasured(profile);
  nlohmann::ordered_json result = {{"one", profile.one},
                                   {"cores", profile.cores},
                                   {"all", profile.all},
                                   {"start", profile.costs.start_seconds},
                                   {"bytes_per_second", profile.costs.bytes_per_second}};
  for (std::size_t i = 0; i < profile.forecasts.size(); ++i) {
    PrintForecast(request.workers[i], profile.forecasts[i], profile.one);
    result["forecasts"].push_back(ToJson(request.workers[i], profile.forecasts[i]));
  }
  PrintResult(result);
  return {};
}

}  // namespace

void AddProfile(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "profile", "Predict the time of a training step on many cores, and its bottlenecks",
      RunProfile);
  command->Add("--config", &options->config, "configuration, as in train", {Required{}});
  command->Add("--data", &options->data, "dataset folder", {Required{}});
  command->Add("--set", &options->overrides, "override a key, as in train (repeatable)");
  command->Add("--workers", &options->workers, "core counts to predict for",
               {SplitAtCommas{}, Range{2, kMostWorkers}});
  command->Add("--steps", &options->steps, "steps to record after three warm-up steps",
               {Range{1, 10000}});
  command->Add(
      "--bandwidth", &options->bandwidth,
      "memory bandwidth of all cores together, GB/s; 0: that of one core here, times cores",
      {NotNegative()});
  command->Add("--start", &options->start,
               "microseconds until a second core takes part in a loop, and until twice as many do "
               "each time; 0: as measured here",
               {NotNegative()});
}

}  // namespace tilegrad::cli

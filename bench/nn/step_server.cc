// SPDX-License-Identifier: Apache-2.0
// Makes a training step for each line of its input, and prints what it took: one line of JSON.
// compare_steps.py drives this program and pytorch_steps.py, which does the same, in turns.
//   nn_step_server NETWORK WORKERS
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <string>

#include "base/parallel.h"
#include "base/simd_target.h"
#include "training_steps.h"

namespace tilegrad::nn::bench {
namespace {

double CpuMilliseconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

double PeakResidentMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024e-6;
}

// Runs one step and prints its times; false where the step failed.
bool Answer(TrainingStep& step, const Context& context) {
  const auto wall = std::chrono::steady_clock::now();
  const double cpu = CpuMilliseconds();
  const Status status = step.Run();
  const double cpu_ms = CpuMilliseconds() - cpu;
  const std::chrono::duration<double, std::milli> wall_ms = std::chrono::steady_clock::now() - wall;
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  std::printf(
      "{\"cpu_ms\": %.3f, \"wall_ms\": %.3f, \"loss\": %.7g, \"rss_mb\": %.1f, "
      "\"pool_mb\": %.1f}\n",
      cpu_ms, wall_ms.count(), step.loss(), PeakResidentMegabytes(),
      static_cast<double>(context.memory().stats().peak_bytes) * 1e-6);
  std::fflush(stdout);
  return status.ok();
}

int Serve(const char* network, int workers_count) {
  const Workers workers(workers_count);
  Context context(workers);
  const auto step = MakeTrainingStep(network, context);
  if (step == nullptr) {
    std::fprintf(stderr, "no network \"%s\"\n", network);
    return 2;
  }
  for (std::string line; std::getline(std::cin, line);) {
    if (!Answer(*step, context)) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace tilegrad::nn::bench

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: nn_step_server reconstruction|critic|adversarial|gan WORKERS\n");
    return 2;
  }
  const tilegrad::Status status = tilegrad::ForceTargetFromEnvironment();
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.message().c_str());
    return 2;
  }
  return tilegrad::nn::bench::Serve(argv[1], std::atoi(argv[2]));
}

// SPDX-License-Identifier: Apache-2.0
// The main of benchmarks that have none of their own.
#include <benchmark/benchmark.h>

#include "start.h"

int main(int argc, char** argv) {
  if (!tilegrad::bench::Start(&argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}

// SPDX-License-Identifier: Apache-2.0
#include "start.h"

#include <benchmark/benchmark.h>

#include <cstdio>

#include "base/simd_target.h"

namespace tilegrad::bench {

bool Start(int* argc, char** argv) {
  benchmark::Initialize(argc, argv);
  if (benchmark::ReportUnrecognizedArguments(*argc, argv)) return false;
  const Status status = ForceTargetFromEnvironment();
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  benchmark::AddCustomContext("simd_target", ActiveTarget());
  return status.ok();
}

}  // namespace tilegrad::bench

// SPDX-License-Identifier: Apache-2.0
#include "base/cores.h"

#include <sched.h>
#include <unistd.h>

namespace tilegrad {

static_assert(kMostCores == CPU_SETSIZE);

int MachineCores() { return static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)); }

void KeepToCores(std::span<const int> cores) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int core : cores) {
    if (core >= 0 && core < kMostCores) CPU_SET(core, &set);
  }
  if (CPU_COUNT(&set) > 0) sched_setaffinity(0, sizeof(set), &set);
}

}  // namespace tilegrad

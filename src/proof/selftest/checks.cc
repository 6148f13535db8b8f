// SPDX-License-Identifier: Apache-2.0
#include "proof/selftest/checks.h"

namespace tilegrad::selftest {

std::vector<Check> AllChecks() {
  std::vector<Check> all;
  for (const auto& group :
       {TriangleChecks, SphereChecks, AlphaBoundChecks, SameBitsChecks, ExtremeChecks, KernelChecks,
        TrainingChecks, FileChecks, MetricChecks}) {
    for (Check& check : group()) all.push_back(std::move(check));
  }
  return all;
}

}  // namespace tilegrad::selftest

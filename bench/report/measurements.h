// SPDX-License-Identifier: Apache-2.0
// What render_bench measured, out of the JSON that Google Benchmark writes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::bench {

// Medians over the repetitions of one benchmark, of a whole batch: what ran on a share of it
// (counter "share") is scaled up.
struct Measurement {
  std::string scene, direction, what, who;  // the parts of its name
  double cpu_ms = 0, wall_ms = 0;
  int repetitions = 0;
  std::map<std::string, double> counters;

  double counter(const std::string& name) const;  // 0 where there is none
};

// In the order of registration. Benchmarks that reported an error are left out; so are those whose
// name has fewer parts. Errors: not JSON, or no measurement in it.
Result<std::vector<Measurement>> ParseMeasurements(std::string json);

// Null if there is none.
const Measurement* Find(const std::vector<Measurement>& all, const Measurement& like,
                        const std::string& who);

}  // namespace tilegrad::bench

// SPDX-License-Identifier: Apache-2.0
// Learning rates that follow the step (0, 1, ..): pure functions, so a resumed run needs no state.
//
//   adam.options().learning_rate = WarmedUp(CosineRate(1e-3, {.steps = 10000}, step), 100, step);
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace tilegrad::nn {

// From the rate at step 0 along half a cosine to final_factor times the rate at `steps`, and that
// from there on (Loshchilov, Hutter 2017). steps >= 1.
struct CosineSchedule {
  std::int64_t steps = 1;
  double final_factor = 0;
};
inline double CosineRate(double rate, const CosineSchedule& schedule, std::int64_t step) {
  const double progress = static_cast<double>(step) / static_cast<double>(schedule.steps);
  const double cosine = 0.5 * (1 + std::cos(std::numbers::pi * std::min(progress, 1.0)));
  return rate * (schedule.final_factor + (1 - schedule.final_factor) * cosine);
}

// Rises to `rate` in equal steps: 1/steps of it at step 0, all of it at step steps - 1.
inline double WarmedUp(double rate, std::int64_t steps, std::int64_t step) {
  return step < steps ? rate * static_cast<double>(step + 1) / static_cast<double>(steps) : rate;
}

}  // namespace tilegrad::nn

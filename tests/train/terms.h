// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>

#include "train/run/step_values.h"

namespace tilegrad::train {

// NaN if there is none of that name.
inline double TermOf(const StepValues& values, const std::string& name) {
  for (const LossTerm& term : values.terms) {
    if (name == term.name) return term.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace tilegrad::train

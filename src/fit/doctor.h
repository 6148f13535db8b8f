// SPDX-License-Identifier: Apache-2.0
// The gradient doctor: says in a sentence why a parameter gets no gradient, or how much of it does.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "fit/fitter.h"

namespace tilegrad::train {

struct Finding {
  Parameter parameter = Parameter::kPositions;
  double share = 0;      // of its numbers that have a gradient other than 0
  bool blocked = false;  // none has
  std::string sentence;
};

// Evaluates one step (without taking it) and looks at every parameter of `options`. Parameters that
// the plan excludes are findings, not errors. Errors: those of Fitter::Evaluate.
Result<std::vector<Finding>> Diagnose(const FitScene& scene, const FitterOptions& options,
                                      const FitStep& step, const Workers& workers);

// Pixels at which a face's share of alpha falls below a millionth, which no gradient is seen from:
// A = exp(-d^2 / delta), d in NDC of an image of `side` pixels.
double ReachInPixels(double delta, int side);

}  // namespace tilegrad::train

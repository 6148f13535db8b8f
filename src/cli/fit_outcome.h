// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: what it says at its end.
#pragma once

#include "fit/run.h"

namespace tilegrad::cli {

// Of --doctor: what each parameter gets.
void PrintDiagnosis(const std::vector<train::Finding>& findings);
// `steps`: the most that it was given.
void PrintFit(const train::FitOutcome& outcome, const Path& out, std::int64_t steps);

}  // namespace tilegrad::cli

// SPDX-License-Identifier: Apache-2.0
#include "train/run/step_values.h"

#include <fmt/format.h>

namespace tilegrad::train {

std::string StepValues::ForConsole() const {
  std::string out = fmt::format("loss {:.4f}", loss);
  for (const LossTerm& term : terms) {
    if (term.weight != 0) out += fmt::format("  {} {:.3g}", term.name, term.value);
  }
  return out;
}

std::string StepValues::DescribeTerms() const {
  std::string out;
  for (const LossTerm& term : terms) {
    out += fmt::format("{}{} {} x {}", out.empty() ? "" : ", ", term.name, term.value, term.weight);
  }
  return out;
}

Scalars StepValues::ForLog() const {
  Scalars out = {{"loss", loss}};
  for (const LossTerm& term : terms) out.emplace_back(term.name, term.value);
  for (const auto& [name, value] : also) out.emplace_back(name, value);
  return out;
}

}  // namespace tilegrad::train

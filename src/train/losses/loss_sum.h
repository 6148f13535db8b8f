// SPDX-License-Identifier: Apache-2.0
// The loss of a step, term by term. A term gets its name, label and weight here; log, console,
// TensorBoard, pages and messages take them from this record.
#pragma once

#include "nn/nn.h"
#include "train/run/log.h"

namespace tilegrad::train {

class LossSum {
 public:
  // Appends to values->terms, and keeps values->loss up to date.
  explicit LossSum(StepValues* values) : values_(*values) {}

  // A scalar. `name` and `label` (see LossTerm) live as long as the program.
  void Add(const char* name, const char* label, double weight, const nn::Var& term) {
    total_ = total_.has_context() ? total_ + weight * term : weight * term;
    values_.terms.push_back({name, weight, term.item(), label});
    values_.loss = total_.item();
  }
  // Logs a value that is not part of the loss.
  void Watch(const char* name, const char* label, double value) {
    values_.terms.push_back({name, 0, value, label});
  }

  const nn::Var& total() const { return total_; }

 private:
  StepValues& values_;
  nn::Var total_;
};

}  // namespace tilegrad::train

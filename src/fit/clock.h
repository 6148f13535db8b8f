// SPDX-License-Identifier: Apache-2.0
// The progress of a fit on its schedule, with early stopping.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fit/config.h"
#include "nn/context.h"
#include "nn/tensor.h"

namespace tilegrad::train {

// Time on the schedule runs from 0 to 1 over `steps` steps. Where the images' loss no longer falls
// (FitConfig::stop_gain), it runs kSpeedup times as fast from there on, so that the fit
// stops early but still completes its schedule (small rates above all). It depends only on the
// losses: it is the same for any number of workers and in a resumed fit.
class FitClock {
 public:
  static constexpr std::int64_t kWindow = 100;  // steps whose losses are compared with as many
  static constexpr int kSpeedup = 3;

  explicit FitClock(const FitConfig& config);

  double At(std::int64_t step) const;        // time before that step, from 0
  std::int64_t End() const { return end_; }  // the steps of the whole fit, as it looks now
  // After a step, with its loss of the images.
  void Note(std::int64_t step, double loss);
  // The steps that were done when a finished fit got more of them; 0: never.
  std::int64_t extended_at() const { return extended_at_; }

  std::vector<nn::NamedTensor> State(nn::Context& context) const;
  // After `steps` steps. States of earlier versions have no clock and never stop early. That of a
  // fit of fewer steps restarts here: time goes back to steps / config.steps. Of more: an error.
  Status LoadState(std::span<const nn::NamedTensor> state, std::int64_t steps);

 private:
  bool MayStopEarly(std::int64_t step) const;
  void StopEarly(std::int64_t step);

  std::int64_t steps_;
  double gain_, earliest_;  // earliest_: time
  std::int64_t end_, stop_started_ = -1, extended_at_ = 0;
  std::int64_t counted_ = 0;      // of the window that is open
  double sum_ = 0, before_ = -1;  // its losses, and those of the window before; -1: none
};

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// How far a fit is on its schedule, which it may hurry along.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fit/config.h"
#include "nn/context.h"
#include "nn/tensor.h"

namespace tilegrad::train {

// Time on the schedule runs from 0 to 1 over `steps` steps. Where the images' loss no longer falls
// (FitConfig::stop_gain), it goes kHurry times as fast from there on: what belongs to the end of a
// fit, small rates above all, comes early and whole, and then the fit is over. All of it is a
// function of the losses, so it is the same for any workers, and in a fit that was resumed.
class FitClock {
 public:
  static constexpr std::int64_t kWindow = 100;  // steps whose losses are compared with as many
  static constexpr int kHurry = 3;

  explicit FitClock(const FitConfig& config);

  double At(std::int64_t step) const;        // time before that step, from 0
  std::int64_t End() const { return end_; }  // the steps of the whole fit, as it looks now
  // After a step, with its loss of the images.
  void Note(std::int64_t step, double loss);
  // The steps that were done when a finished fit got more of them; 0: never.
  std::int64_t extended_at() const { return extended_at_; }

  std::vector<nn::NamedTensor> State(nn::Context& context) const;
  // After `steps` steps. States of earlier versions have no clock, and never hurried. That of a fit
  // of fewer steps begins anew from here: time goes back to steps / config.steps. Of more: an
  // error.
  Status LoadState(std::span<const nn::NamedTensor> state, std::int64_t steps);

 private:
  bool MayHurry(std::int64_t step) const;
  void Hurry(std::int64_t step);

  std::int64_t steps_;
  double gain_, earliest_;  // earliest_: time
  std::int64_t end_, hurried_at_ = -1, extended_at_ = 0;
  std::int64_t counted_ = 0;      // of the window that is open
  double sum_ = 0, before_ = -1;  // its losses, and those of the window before; -1: none
};

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// An update by portions of the batch, on one process or many ranks: the same bits.
#pragma once

#include <memory>

#include "train/ranks/crew.h"
#include "train/ranks/gradient_sums.h"
#include "train/ranks/value_sums.h"
#include "train/run/schedule.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

class PortionedUpdate {
 public:
  // `crew`: of all ranks, or null. InvalidArgument where the task or the number of ranks do not
  // allow so many portions.
  static Result<std::unique_ptr<PortionedUpdate>> Make(nn::Context& context, Task& task,
                                                       const Schedule& schedule, Crew* crew);

  // Task::Backward of this rank's portions, the means of all, Task::Update. `values` are those of
  // the whole batch on rank 0; elsewhere they mean nothing.
  Status Run(const UpdateIndex& at, StepValues* values);

  // Moments of optimisers that are spread over ranks come to rank 0. Every rank calls it where
  // HasMoments, which is the same on all.
  bool HasMoments() const { return sums_->share() && sums_->share()->HasMoments(); }
  void GatherMoments() { sums_->share()->GatherMoments(); }

 private:
  PortionedUpdate(Task& task, Crew* crew, std::int64_t portions,
                  std::unique_ptr<GradientSums> sums);
  Status Backward(UpdateIndex at);
  Status Finish(StepValues* values);
  Status Update(UpdateIndex at, StepValues* values);
  void AddValues();
  void TakeValues(std::span<const double> sums, StepValues* values) const;

  Task& task_;
  Crew* crew_;
  std::int64_t portions_;
  std::unique_ptr<GradientSums> sums_;
  ValueSums value_sums_;
  Status alarm_;                 // of another rank, in the middle of an update
  StepValues portion_;           // of the last portion
  std::vector<double> numbers_;  // of it: loss, images, stream seconds, terms
};

}  // namespace tilegrad::train

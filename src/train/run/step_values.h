// SPDX-License-Identifier: Apache-2.0
// What a step says about itself. The log, TensorBoard, the console and the report show whatever
// terms there are; none of them knows one by name.
#pragma once

#include <string>
#include <vector>

#include "train/run/log.h"

namespace tilegrad::train {

struct LossTerm {
  const char* name;        // its key in metrics.jsonl; not "step", "loss", "images_per_second",
                           // "seconds", "stream_share", "wait_share", "summed_numbers"
  double weight;           // in the loss; 0: only watched
  double value;            // before the weight
  const char* label = "";  // for people; "": the name says it
};

// Cleared and filled anew by each step: a steady state keeps the memory.
struct StepValues {
  double loss = 0;  // what the step went down on
  std::vector<LossTerm> terms;
  std::vector<std::pair<const char*, double>> also;  // for the log: learning rate, epoch, ...
  std::int64_t images = 0;                           // that the step worked on
  double stream_seconds = 0;  // of processor time, for pictures that it rendered to learn from
  double wait_seconds = 0;    // for gradients of other ranks, after its own were there
  double summed_numbers = 0;  // with other ranks, in all updates of the step

  void Clear() {  // all but the loss, which a step may leave as it was
    terms.clear();
    also.clear();
    images = 0;
    stream_seconds = wait_seconds = summed_numbers = 0;
  }
  // The loss, and its terms without their weights: "loss 2.5690  iou 0.246  color 0.111".
  std::string ForConsole() const;
  // "iou 0.5 x 1, color nan x 1".
  std::string DescribeTerms() const;
  // "loss", the terms without their weights, then `also`.
  Scalars ForLog() const;
};

}  // namespace tilegrad::train

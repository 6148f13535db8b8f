// SPDX-License-Identifier: Apache-2.0
// What sets of generated and true objects are compared by.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "train/losses/feature_l1.h"
#include "train/metrics/feature_rows.h"
#include "train/tasks/gan/real_pictures.h"

namespace tilegrad::train {

// Which columns differ within the truth. The others are cells at the edge of what any object
// covers: standardised, they would decide alone.
std::vector<std::uint8_t> VariedColumns(const FeatureRows& truth);
// 0 in all others.
FeatureRows Only(FeatureRows rows, const std::vector<std::uint8_t>& columns);

// Features of pictures: the cells of each view, or what the levels of a classifier say on average
// of the pixels of all views.
class Judge {
 public:
  // `run`: of task.kind = "classify"; empty: cells.
  static Result<Judge> Make(nn::Context& context, const Path& run);
  std::string name() const;  // in words
  Result<FeatureRows> Pictures(const ObjectViews& set) const;

 private:
  explicit Judge(nn::Context& context) : context_(context) {}
  Result<FeatureRows> Levels(const ObjectViews& set) const;
  nn::Context& context_;
  FeatureFunction network_;
};

}  // namespace tilegrad::train

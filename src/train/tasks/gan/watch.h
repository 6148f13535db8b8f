// SPDX-License-Identifier: Apache-2.0
// Monitors the generator during training: the distance of its samples from true pictures as a set,
// and their diversity.
#pragma once

#include "train/metrics/set_scores.h"
#include "train/tasks/gan/real_samples.h"
#include "train/tasks/gan/step.h"

namespace tilegrad::train {

// Diversity of a set: means over all pairs of its objects.
struct Spread {
  double shapes = 0;  // 1 - IoU of silhouettes, soft, over the four views together
  double colors = 0;  // distance of the objects' mean colours, RGB in [0, 1]
};
Spread SpreadOf(const ObjectViews& set, const Workers& workers);

inline constexpr std::int64_t kCells = 8;
// Each view's planes averaged over cells x cells cells; for colours also their standard deviation
// within each cell, or a blurred texture would score as well as a sharp one.
FeatureRows CoverFeatures(const ObjectViews& set);
FeatureRows ColorFeatures(const ObjectViews& set, std::int64_t cells = kCells);

// `distance`: the kernel distance of the features, times 1000; lower is better, 0 for equal
// distributions. The others: spread as a share of the true pictures'.
struct Watched {
  double distance = 0, shapes = 0, colors = 0;
};

class GanWatch {
 public:
  // Compares with `truth`, which no critic sees.
  GanWatch(const ObjectViews& truth, const Workers& workers);
  Result<Watched> Compare(const ObjectViews& generated, GanStage stage) const;
  const Spread& truth() const { return spread_; }

 private:
  const Workers& workers_;
  FeatureRows cover_, colors_;
  Spread spread_;
};

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Monitors the generator during training: the distance of its samples from true pictures as a set,
// and their diversity.
#pragma once

#include "train/metrics/set_scores.h"
#include "train/tasks/gan/real_pictures.h"
#include "train/tasks/gan/step.h"

namespace tilegrad::train {

// How different the objects of a set are: means over all pairs.
struct Spread {
  double shapes = 0;  // 1 - IoU of silhouettes, soft, over the four views together
  double colors = 0;  // distance of the mean colours of the objects, RGB in [0, 1]
};
Spread SpreadOf(const ObjectViews& set, const Workers& workers);

inline constexpr std::int64_t kCells = 8;
// Each view's planes averaged over cells, cells x cells to a plane; of colours also their deviation
// within each cell, or a blurred texture would be as good as a crisp one.
FeatureRows CoverFeatures(const ObjectViews& set);
FeatureRows ColorFeatures(const ObjectViews& set, std::int64_t cells = kCells);

// What is watched. `distance`: the kernel distance of the features, times 1000, where less is
// better; 0 of sets that are alike. The others as shares of the true pictures' spread.
struct Watched {
  double distance = 0, shapes = 0, colors = 0;
};

class GanWatch {
 public:
  // Beside `truth`, which no critic saw.
  GanWatch(const ObjectViews& truth, const Workers& workers);
  Result<Watched> Compare(const ObjectViews& generated, GanStage stage) const;
  const Spread& truth() const { return spread_; }

 private:
  const Workers& workers_;
  FeatureRows cover_, colors_;
  Spread spread_;
};

}  // namespace tilegrad::train

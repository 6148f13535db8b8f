// SPDX-License-Identifier: Apache-2.0
// What a step sees.
#pragma once

#include <vector>

#include "nn/context.h"
#include "train/run/portion.h"
#include "train/tasks/next_batch.h"
#include "train/tasks/photographs/config.h"

namespace tilegrad::train {

// B photographs of S pixels a side with K keypoints.
struct PhotographBatch {
  nn::Tensor input;                      // [B, 3, S, S], what the network sees
  nn::Tensor colors;                     // [B, 3, S, S], of the object over black
  nn::Tensor mask;                       // [B, S, S]
  nn::Tensor barrier;                    // [B, 1, S, S] DistanceBarrier; of a flow
  nn::Tensor keypoints;                  // [B, K, 2], 0 where not visible; none without keypoints
  nn::Tensor visible;                    // [B, K, 1] 1 or 0
  std::vector<WeakPerspective> cameras;  // [B]
  std::vector<CroppedPhoto> crops;       // [B]
  Portion portion{};                     // of the step's batch
};

struct PhotographPlaces {
  std::vector<int> photographs;  // of the store
  std::int64_t first = 0;        // place in the run of the first of them
};
// A random crop of each of `photographs`, which follows from their places in the run: `first`,
// first + 1, ..; or with `first` < 0 the crop as it is. `config` and `store` outlive the work.
BatchWork<PhotographBatch> PhotographWork(nn::Context& context, const PhotographsConfig& config,
                                          const PhotoStore& store, PhotographPlaces places);
// The same, on all workers.
PhotographBatch GatherPhotographs(nn::Context& context, const PhotographsConfig& config,
                                  const PhotoStore& store, const std::vector<int>& photographs,
                                  std::int64_t first);

}  // namespace tilegrad::train

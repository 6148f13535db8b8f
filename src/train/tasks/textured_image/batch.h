// SPDX-License-Identifier: Apache-2.0
// What a step sees: objects in two views, each under a light of its own.
#pragma once

#include <vector>

#include "nn/context.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"
#include "train/tasks/next_batch.h"

namespace tilegrad::train {

inline constexpr int kViewsOfObject = 2;

// M = 2 B inputs: 2 b and 2 b + 1 are the views of object b. The mesh that is predicted from input
// m is seen in N = 2 M images: 2 m in its own view, 2 m + 1 in the other one of its object.
struct TexturedBatch {
  nn::Tensor input;                 // [M, 4, size, size]
  nn::Tensor truth_colors;          // [N, 3, size, size]
  nn::Tensor truth_alpha;           // [N, size, size]
  std::vector<Camera> cameras;      // [N]
  std::vector<TexturedView> views;  // [M]
  Portion portion{};                // of the step's batch
  double stream_seconds = 0;        // of processor time, for its pictures
};

// The input whose view image n shows.
constexpr std::size_t InputOfImage(std::size_t n) { return n % 2 == 0 ? n / 2 : (n / 2) ^ 1; }

// One object for each of `models`. `first`: position in the run of the first. The stream outlives
// the work, whose lanes are the stream's.
BatchWork<TexturedBatch> RenderWork(nn::Context& context, TexturedStream& stream, int size,
                                    std::vector<Sample> models, std::int64_t first);
// The same, on all workers.
Result<TexturedBatch> RenderBatch(nn::Context& context, TexturedStream& stream, int size,
                                  const std::vector<Sample>& models, std::int64_t first);

}  // namespace tilegrad::train

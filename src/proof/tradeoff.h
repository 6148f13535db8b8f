// SPDX-License-Identifier: Apache-2.0
// What an error bound buys: alpha and its gradient at several max_alpha_error, against the naive
// renderer in float64 over all faces.
#pragma once

#include <cstddef>
#include <vector>

#include "base/progress.h"
#include "render/pipeline/pipeline.h"
#include "tilegrad/status.h"

namespace tilegrad {

struct TradeoffJob {
  PipelineScene scene;         // its positions, faces and camera; attributes are not looked at
  RenderOptions options;       // max_alpha_error is replaced
  std::vector<double> errors;  // values of max_alpha_error to try, each in [0, 1]
  bool paper_rule = true;      // also try AlphaRule::kPaper, last
  int repetitions = 7;         // timings of each setting, taken in turns
  // Pairs of pixel and face that the truth may cost, twice (forward, backward): where the whole
  // image would cost more, evenly spread rows stand for it.
  double truth_pairs = 2e8;
};

// One setting. Errors are over the background pixels of the rows that have a truth.
struct TradeoffRow {
  AlphaRule rule = AlphaRule::kAllFaces;
  double max_alpha_error = 0;              // infinite with AlphaRule::kPaper
  double forward_ms = 0, backward_ms = 0;  // median CPU time of the whole image, one thread
  double reported = 0;                     // PipelineFrame::alpha_error_bound
  double largest = 0, mean = 0;            // |alpha - truth|
  double gradient_angle = 0;  // degrees, between dL/d(positions) and its truth; L a random sum
  double gradient_error = 0;  // |difference| / |truth|
};

struct Tradeoff {
  std::vector<TradeoffRow> rows;       // as TradeoffJob::errors, then the paper's rule
  int truth_rows = 0, image_rows = 0;  // of pixels
  std::size_t faces = 0;
  double truth_forward_ms = 0, truth_backward_ms = 0;  // float64, all faces, of the whole image
};

// Errors: those of Renderer::Render, an empty or invalid list of errors, a scene without gradient
// (nothing near background); kCancelled when `stop` is set. Random numbers are seeded: the same
// accuracies every time.
Result<Tradeoff> MeasureTradeoff(const TradeoffJob& job, const ProgressSink& progress,
                                 const StopFlag& stop);

}  // namespace tilegrad

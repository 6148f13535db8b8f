// SPDX-License-Identifier: Apache-2.0
// The parts of `tilegrad tradeoff`: what it renders, what it trains, and the reports it writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "tilegrad/renderer.h"
#include "tilegrad/status.h"

namespace tilegrad {

// What an error bound costs and buys: alpha and its gradient at several max_alpha_error, against
// the naive renderer in float64 over all faces.

struct TradeoffJob {
  Scene scene;                 // positions, faces and camera
  RenderOptions options;       // max_alpha_error is overridden
  std::vector<double> errors;  // values of max_alpha_error to try, each in [0, 1]
  bool paper_rule = true;      // also try AlphaRule::kPaper, last
  int repetitions = 7;         // timings per setting, interleaved
  // Limit on pairs of pixel and face for the ground truth, applied to forward and backward each: if
  // the whole image would exceed it, evenly spaced rows are used instead.
  double truth_pairs = 2e8;
};

// One setting. Errors are over the background pixels of the rows with ground truth.
struct TradeoffRow {
  AlphaRule rule = AlphaRule::kAllFaces;
  double max_alpha_error = 0;              // infinite with AlphaRule::kPaper
  double forward_ms = 0, backward_ms = 0;  // median CPU time of the whole image, one thread
  double reported = 0;                     // Images::alpha_error_bound
  double largest = 0, mean = 0;            // |alpha - truth|
  double gradient_angle = 0;  // degrees, between dL/d(positions) and its truth; L is a random sum
  double gradient_error = 0;  // |difference| / |truth|
};

struct Tradeoff {
  std::vector<TradeoffRow> rows;       // in the order of TradeoffJob::errors, then the paper's rule
  int truth_rows = 0, image_rows = 0;  // of pixels
  std::size_t faces = 0;
  double truth_forward_ms = 0, truth_backward_ms = 0;  // float64, all faces, of the whole image
};

// Errors: those of Renderer::Render, an empty or invalid list of errors, a scene without gradient
// (nothing near background); kCancelled when `stop` is set. Random numbers are seeded: accuracies
// are reproducible.
Result<Tradeoff> MeasureTradeoff(const TradeoffJob& job, const Watch& watch);

// Something to render: one mesh from one camera.
struct StudyScene {
  std::string name;
  int size = 0;                     // pixels, each axis
  std::vector<float> positions;     // [V,3]
  std::vector<std::int32_t> faces;  // [F,3]
  Camera camera;
};

// A small sphere as in training (64 pixels), and a large bumpy one (256).
std::vector<StudyScene> BuiltInScenes();
// A mesh file, centred, viewed from above and from the side.
Result<StudyScene> SceneFromFile(const Path& file, int size);

// The results of one scene with one kernel.
struct StudyResult {
  std::string scene;
  int size = 0;
  double delta = 0;
  Tradeoff tradeoff;
};

// End to end: the result of training with one max_alpha_error.
struct StudyTraining {
  double max_alpha_error = 0;
  double seconds = 0;  // of training
  std::int64_t steps = 0;
  double iou = 0, f_score = 0;  // means over classes on held-out models, in [0, 1]
};

struct TrainingStudyJob {
  Path data, config, out;  // starts or resumes a run for each error below `out`
  std::vector<double> errors;
  int steps = 0;
  WarningSink warn = nullptr;  // as in train::TrainJob
};
// Whether dataset and configuration are readable; checked first, since the measurement takes
// minutes.
Status CheckTrainingStudy(const TrainingStudyJob& job);
Result<std::vector<StudyTraining>> RunTrainingStudy(const TrainingStudyJob& job,
                                                    const Workers& workers, const Watch& watch);

// Tables in Markdown, the same numbers in CSV, and the Pareto plot in SVG (log-log: CPU time of
// forward and backward against the largest error of alpha).
std::string StudyMarkdown(const std::vector<StudyResult>& results,
                          const std::vector<StudyTraining>& training);
std::string StudyCsv(const std::vector<StudyResult>& results);
std::string TrainingCsv(const std::vector<StudyTraining>& training);
std::string StudyPicture(const std::vector<StudyResult>& results);

}  // namespace tilegrad

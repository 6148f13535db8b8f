// SPDX-License-Identifier: Apache-2.0
// The parts of `tilegrad tradeoff`: what is rendered, what is trained, and the files that say how
// it went.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "proof/tradeoff.h"

namespace tilegrad::cli {

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
// A mesh file, centred, seen from above and from the side.
Result<StudyScene> SceneFromFile(const Path& file, int size);

// How one scene did with one kernel.
struct StudyResult {
  std::string scene;
  int size = 0;
  double delta = 0;
  Tradeoff tradeoff;
};

// The end of the line: what was learned with one max_alpha_error.
struct StudyTraining {
  double max_alpha_error = 0;
  double seconds = 0;  // of training
  std::int64_t steps = 0;
  double iou = 0, f_score = 0;  // means over classes on held-out models, in [0, 1]
};

struct TrainingStudyJob {
  Path data, config, out;  // a run for each error is made below `out`, or continued
  std::vector<double> errors;
  int steps = 0;
  WarningSink warn = nullptr;  // as of train::TrainJob
};
// Whether dataset and configuration can be read: measuring, which comes first, takes minutes.
Status CheckTrainingStudy(const TrainingStudyJob& job);
Result<std::vector<StudyTraining>> RunTrainingStudy(const TrainingStudyJob& job,
                                                    const Workers& workers,
                                                    const ProgressSink& progress,
                                                    const StopFlag& stop);

// Tables as Markdown, the same numbers as CSV, and the Pareto picture as SVG (log-log: CPU time of
// forward and backward against the largest error of alpha).
std::string StudyMarkdown(const std::vector<StudyResult>& results,
                          const std::vector<StudyTraining>& training);
std::string StudyCsv(const std::vector<StudyResult>& results);
std::string TrainingCsv(const std::vector<StudyTraining>& training);
std::string StudyPicture(const std::vector<StudyResult>& results);

}  // namespace tilegrad::cli

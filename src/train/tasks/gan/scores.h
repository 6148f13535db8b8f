// SPDX-License-Identifier: Apache-2.0
// Compares sets of generated and true objects: their distance, diversity and memorisation. All true
// objects are drawn with the run's augmentation, as its training data was.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/file.h"
#include "train/metrics/set_scores.h"
#include "train/tasks/gan/model.h"
#include "train/tasks/gan/real_samples.h"
#include "train/tasks/gan/watch.h"

namespace tilegrad::train {

struct GanScoreJob {
  Path run, data;
  int count = 256;         // objects of each set
  std::uint64_t seed = 0;  // of the latent codes
  Path judge;              // a run of task.kind = "classify"; empty: cells of the pictures
};

// One set compared with true objects of one split.
struct GanScoreRow {
  std::string method;  // "generator", "mean texture", ..., last "true objects": the floor
  SetScore pictures, shapes;
  Spread spread;  // as shares of the truth's
};

struct GanScores {
  std::size_t n = 0;                           // objects on each side of a comparison
  std::string judge;                           // in words
  Spread truth;                                // of training objects
  std::vector<GanScoreRow> trained, held_out;  // against training shapes, and test shapes
  Memorisation memorisation;  // by pictures: samples and held-out objects, to training objects
  // Rows: a sample, then the nearest training object; columns: three of the critic's views.
  ImageU8 nearest;
};

// Errors: as CheckHeldOut; an unreadable judge; too few objects.
Result<GanScores> ScoreGenerator(GeneratorModel& model, const GanScoreJob& job, const Watch& watch);
std::string FormatScores(const GanScores& scores);  // Markdown tables
nlohmann::ordered_json ScoresJson(const GanScores& scores);

}  // namespace tilegrad::train

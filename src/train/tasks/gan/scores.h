// SPDX-License-Identifier: Apache-2.0
// Compares sets of generated and true objects: their distance, diversity and memorisation. All true
// objects are drawn with the run's augmentation, as its training data was.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/file.h"
#include "train/losses/l1.h"
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

// The features by which sets of generated and true objects are compared.

// 1 for columns that vary within the truth. The others are cells at the edge of what any object
// covers: standardised, they would dominate all distances.
std::vector<std::uint8_t> VariedColumns(const FeatureRows& truth);
// Sets all other columns to 0.
FeatureRows Only(FeatureRows rows, const std::vector<std::uint8_t>& columns);

// Features of pictures: the cells of each view, or the levels of a classifier, averaged over the
// pixels of all views.
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

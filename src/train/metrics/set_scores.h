// SPDX-License-Identifier: Apache-2.0
// Scores of a set of generated pictures against true ones, with what chance alone gives beside
// each: the floor.
#pragma once

#include "train/metrics/neighbours.h"

namespace tilegrad::train {

struct SetScore {
  double frechet = 0;   // as they are
  double kernel = 0;    // standardised by the truth
  Coverage coverage{};  // standardised by the truth, k = kNeighbours
};

// All figures are of `n` rows on each side, as each of them depends on that number.
struct SetScores {
  std::size_t n = 0;
  SetScore generated;  // n generated rows against n true ones
  SetScore floor;      // n other true rows against the same: what a perfect generator would get
};

// n is the smaller of the generated rows and half of the true ones; both sides are drawn by `seed`.
// More than kNeighbours rows must remain. `truth` should be what the generator was not trained on.
Result<SetScores> ScoreSets(const FeatureRows& truth, const FeatureRows& generated,
                            std::uint64_t seed, const Workers& workers);

}  // namespace tilegrad::train

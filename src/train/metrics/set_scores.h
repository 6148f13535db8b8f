// SPDX-License-Identifier: Apache-2.0
// Scores of sets of pictures by their features. Those by nearest neighbours are by brute force, on
// all workers, with the same bits for any number of them.
#pragma once

#include "train/metrics/feature_rows.h"

namespace tilegrad::train {

// Whether what is generated looks like the truth (precision), and whether all of the truth is
// generated (recall); in [0, 1]. Kynkaanniemi et al. 2019: a point counts as covered by a set if it
// is no farther from some point of it than that point's k-th nearest neighbour in the set.
struct Coverage {
  double precision = 0;  // share of generated points that the truth covers
  double recall = 0;     // share of true points that the generated set covers
};
inline constexpr int kNeighbours = 3;
// More than k rows each.
Result<Coverage> PrecisionRecall(const FeatureRows& truth, const FeatureRows& generated,
                                 const Workers& workers, int k = kNeighbours);

struct Nearest {
  std::size_t row = 0;  // the first of equals
  double distance = 0;  // Euclidean
};
// For each row of `from` the nearest of `to`. At least one row each.
Result<std::vector<Nearest>> NearestRows(const FeatureRows& from, const FeatureRows& to,
                                         const Workers& workers);

// Whether a generator repeats its training data: distances of samples to the nearest training
// picture, beside those of true pictures that were not trained on.
struct Memorisation {
  std::vector<Nearest> samples, held_out;  // as NearestRows, to the training set
  double sample_median = 0, held_out_median = 0;
  // The probability that a sample is nearer to the training set than a held-out picture, ties
  // counting half: 0.5 where the two distributions are alike, 1 where every sample is a copy.
  double nearer = 0;
};
Result<Memorisation> MeasureMemorisation(const FeatureRows& samples, const FeatureRows& held_out,
                                         const FeatureRows& train, const Workers& workers);

// Of a set of generated pictures against true ones, with what chance alone gives beside each: the
// floor.
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

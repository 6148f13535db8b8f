// SPDX-License-Identifier: Apache-2.0
// Scores of sets of pictures by their features. Nearest neighbours are found by brute force on all
// workers, with the same bits for any number of them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// Pictures or shapes as points in feature space, the input of set metrics.

// `rows` points of `width` coordinates, row-major.
struct FeatureRows {
  std::vector<float> values;
  std::size_t width = 0;

  std::size_t rows() const { return width == 0 ? 0 : values.size() / width; }
  std::span<const float> Row(std::size_t i) const {
    return std::span(values).subspan(i * width, width);
  }
};

// InvalidArgument with `what` if there are fewer than `least` rows, values that fill no whole row,
// or one that is not finite.
Status CheckRows(const FeatureRows& rows, std::size_t least, const char* what);

// `count` of the rows, or all if there are fewer, drawn without replacement by `seed`.
FeatureRows DrawRows(const FeatureRows& from, std::size_t count, std::uint64_t seed);
// Rows [begin, end).
FeatureRows SliceRows(const FeatureRows& from, std::size_t begin, std::size_t end);

// Each column of `rows` minus its mean in `reference`, divided by its standard deviation there;
// columns that are constant there become 0.
FeatureRows Standardised(const FeatureRows& rows, const FeatureRows& reference);

// Whether generated points look like the truth (precision), and whether they cover all of it
// (recall); in [0, 1]. Kynkaanniemi et al. 2019: a set covers a point that is no farther from some
// point of the set than that point's k-th nearest neighbour in the set.
struct Coverage {
  double precision = 0;  // share of generated points that the truth covers
  double recall = 0;     // share of true points that the generated set covers
};
inline constexpr int kNeighbours = 3;
// More than k rows each.
Result<Coverage> PrecisionRecall(const FeatureRows& truth, const FeatureRows& generated,
                                 const Workers& workers, int k = kNeighbours);

struct Nearest {
  std::size_t row = 0;  // the first of ties
  double distance = 0;  // Euclidean
};

// For each row of `from` the nearest of `to`. At least one row each.
Result<std::vector<Nearest>> NearestRows(const FeatureRows& from, const FeatureRows& to,
                                         const Workers& workers);

// Whether a generator memorises its training data: distances of samples to the nearest training
// picture, compared with those of held-out pictures.
struct Memorisation {
  std::vector<Nearest> samples, held_out;  // as NearestRows, to the training set
  double sample_median = 0, held_out_median = 0;
  // The probability that a sample is nearer to the training set than a held-out picture, ties
  // counting half: 0.5 where the two distributions are alike, 1 where every sample is a copy.
  double nearer = 0;
};

Result<Memorisation> MeasureMemorisation(const FeatureRows& samples, const FeatureRows& held_out,
                                         const FeatureRows& train, const Workers& workers);

// Scores of generated pictures against true ones, each with its floor: the score of other true
// pictures.
struct SetScore {
  double frechet = 0;   // of the raw features
  double kernel = 0;    // standardised by the truth
  Coverage coverage{};  // standardised by the truth, k = kNeighbours
};

// All scores use `n` rows on each side, because they depend on that number.
struct SetScores {
  std::size_t n = 0;
  SetScore generated;  // n generated rows against n true ones
  SetScore floor;      // n other true rows against the same: what a perfect generator would get
};

// n is the smaller of the generated rows and half of the true ones; `seed` draws both sides. n must
// exceed kNeighbours. `truth` should be held out from the generator's training.
Result<SetScores> ScoreSets(const FeatureRows& truth, const FeatureRows& generated,
                            std::uint64_t seed, const Workers& workers);

// Distances between the feature distributions of two sets of pictures. They are biased for small
// sets, so compare only scores of equal set sizes (ScoreSets). With features of any network but
// Inception v3 this is not "FID".

// Frechet distance of the normal distributions of two sets (Dowson, Landau 1982; Heusel et al.
// 2017): |m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2)), C the unbiased covariances. At least 2
// rows each. For f32 features it is accurate to 1e-6 of the traces, as sqrt amplifies their
// rounding.
Result<double> FrechetDistance(const FeatureRows& a, const FeatureRows& b);

// Kernel distance (Binkowski et al. 2018): the unbiased estimate of the squared maximum mean
// discrepancy with k(x, y) = (x . y / width + 1)^3, which may fall below 0; at least 2 rows each.
// Standardise the rows first (by the true set), or the columns with the largest range dominate.
// Same bits for any worker count.
Result<double> KernelDistance(const FeatureRows& a, const FeatureRows& b, const Workers& workers);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/set_scores.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "train/metrics/frechet.h"

namespace tilegrad::train {
namespace {

// Squared distance of each row to its k-th nearest other row.
std::vector<double> Radii(const FeatureRows& rows, int k, const Workers& workers) {
  std::vector<double> out(rows.rows());
  workers.For(rows.rows(), [&](std::size_t i, std::size_t) {
    std::vector<double> distances;
    for (std::size_t j = 0; j < rows.rows(); ++j) {
      if (j != i) distances.push_back(SquaredDistance(rows.Row(i), rows.Row(j)));
    }
    std::nth_element(distances.begin(), distances.begin() + (k - 1), distances.end());
    out[i] = distances[static_cast<std::size_t>(k - 1)];
  });
  return out;
}

// The share of `points` that `set` covers.
double Covered(const FeatureRows& points, const FeatureRows& set, int k, const Workers& workers) {
  const std::vector<double> radii = Radii(set, k, workers);
  std::vector<std::uint8_t> covered(points.rows(), 0);
  workers.For(points.rows(), [&](std::size_t i, std::size_t) {
    for (std::size_t j = 0; j < set.rows() && !covered[i]; ++j)
      covered[i] = SquaredDistance(points.Row(i), set.Row(j)) <= radii[j];
  });
  return static_cast<double>(std::count(covered.begin(), covered.end(), 1)) /
         static_cast<double>(points.rows());
}

std::vector<double> SortedDistances(const std::vector<Nearest>& nearest) {
  std::vector<double> out;
  for (const Nearest& n : nearest) out.push_back(n.distance);
  std::sort(out.begin(), out.end());
  return out;
}

double Median(const std::vector<double>& sorted) {
  const std::size_t half = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
}

// The share of pairs in which the first is smaller, ties counting half (Mann, Whitney 1947).
double ShareSmaller(const std::vector<double>& a, const std::vector<double>& b) {
  double pairs = 0;
  for (const double x : a) {
    const auto [low, high] = std::equal_range(b.begin(), b.end(), x);
    pairs += static_cast<double>(b.end() - high) + 0.5 * static_cast<double>(high - low);
  }
  return pairs / (static_cast<double>(a.size()) * static_cast<double>(b.size()));
}

}  // namespace

Result<Coverage> PrecisionRecall(const FeatureRows& truth, const FeatureRows& generated,
                                 const Workers& workers, int k) {
  if (k < 1) return InvalidArgument("precision and recall: k is {}, but must be at least 1", k);
  TILEGRAD_TRY(
      CheckPair(truth, generated, static_cast<std::size_t>(k) + 1, "precision and recall"));
  return Coverage{Covered(generated, truth, k, workers), Covered(truth, generated, k, workers)};
}

Result<std::vector<Nearest>> NearestRows(const FeatureRows& from, const FeatureRows& to,
                                         const Workers& workers) {
  TILEGRAD_TRY(CheckPair(from, to, 1, "nearest neighbours"));
  std::vector<Nearest> out(from.rows());
  workers.For(from.rows(), [&](std::size_t i, std::size_t) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < to.rows(); ++j) {
      const double d = SquaredDistance(from.Row(i), to.Row(j));
      if (d < least) {
        least = d;
        out[i].row = j;
      }
    }
    out[i].distance = std::sqrt(least);
  });
  return out;
}

Result<Memorisation> MeasureMemorisation(const FeatureRows& samples, const FeatureRows& held_out,
                                         const FeatureRows& train, const Workers& workers) {
  Memorisation out;
  TILEGRAD_ASSIGN(out.samples, NearestRows(samples, train, workers));
  TILEGRAD_ASSIGN(out.held_out, NearestRows(held_out, train, workers));
  const auto a = SortedDistances(out.samples), b = SortedDistances(out.held_out);
  out.sample_median = Median(a);
  out.held_out_median = Median(b);
  out.nearer = ShareSmaller(a, b);
  return out;
}

namespace {

Result<SetScore> ScoreOf(const FeatureRows& truth, const FeatureRows& other,
                         const Workers& workers) {
  SetScore out;
  TILEGRAD_ASSIGN(out.frechet, FrechetDistance(truth, other));
  const FeatureRows a = Standardised(truth, truth), b = Standardised(other, truth);
  TILEGRAD_ASSIGN(out.kernel, KernelDistance(a, b, workers));
  TILEGRAD_ASSIGN(out.coverage, PrecisionRecall(a, b, workers));
  return out;
}

}  // namespace

Result<SetScores> ScoreSets(const FeatureRows& truth, const FeatureRows& generated,
                            std::uint64_t seed, const Workers& workers) {
  constexpr std::size_t kLeast = kNeighbours + 1;
  TILEGRAD_TRY(CheckRows(truth, 2 * kLeast, "scores of sets, truth"));
  TILEGRAD_TRY(CheckRows(generated, kLeast, "scores of sets, generated"));
  SetScores out;
  out.n = std::min(generated.rows(), truth.rows() / 2);
  const FeatureRows drawn = DrawRows(truth, 2 * out.n, seed);
  const FeatureRows half = SliceRows(drawn, 0, out.n), other = SliceRows(drawn, out.n, 2 * out.n);
  TILEGRAD_ASSIGN(out.generated, ScoreOf(half, DrawRows(generated, out.n, seed + 1), workers));
  TILEGRAD_ASSIGN(out.floor, ScoreOf(half, other, workers));
  return out;
}

}  // namespace tilegrad::train

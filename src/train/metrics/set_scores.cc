// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/set_scores.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"
#include "train/dense.h"

namespace tilegrad::train {
namespace {

// |a - b|^2 in double, in order.
double SquaredDistance(std::span<const float> a, std::span<const float> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += d * d;
  }
  return sum;
}

// As CheckRows for two sets, whose widths must agree.
Status CheckPair(const FeatureRows& a, const FeatureRows& b, std::size_t least, const char* what) {
  TILEGRAD_TRY(CheckRows(a, least, what));
  TILEGRAD_TRY(CheckRows(b, least, what));
  if (a.width == b.width) return {};
  return InvalidArgument("{}: rows of {} columns beside rows of {}", what, a.width, b.width);
}

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

Result<SetScore> ScoreOf(const FeatureRows& truth, const FeatureRows& other,
                         const Workers& workers) {
  SetScore out;
  TILEGRAD_ASSIGN(out.frechet, FrechetDistance(truth, other));
  const FeatureRows a = Standardised(truth, truth), b = Standardised(other, truth);
  TILEGRAD_ASSIGN(out.kernel, KernelDistance(a, b, workers));
  TILEGRAD_ASSIGN(out.coverage, PrecisionRecall(a, b, workers));
  return out;
}

struct NormalFit {
  std::vector<double> mean, covariance;
};

NormalFit NormalFitOf(const FeatureRows& rows) {
  const std::size_t n = rows.rows(), d = rows.width;
  NormalFit out{std::vector<double>(d), std::vector<double>(d * d)};
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t i = 0; i < d; ++i) out.mean[i] += static_cast<double>(rows.Row(r)[i]);
  for (double& mean : out.mean) mean /= static_cast<double>(n);
  std::vector<double> x(d);
  for (std::size_t r = 0; r < n; ++r) {
    for (std::size_t i = 0; i < d; ++i) x[i] = static_cast<double>(rows.Row(r)[i]) - out.mean[i];
    for (std::size_t i = 0; i < d; ++i)
      for (std::size_t j = 0; j < d; ++j) out.covariance[i * d + j] += x[i] * x[j];
  }
  for (double& c : out.covariance) c /= static_cast<double>(n - 1);
  return out;
}

// The eigenvalues of a covariance that rounding has left below 0 are 0.
double Root(double eigenvalue) { return std::sqrt(std::max(eigenvalue, 0.0)); }

double Trace(const std::vector<double>& a, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += a[i * (n + 1)];
  return sum;
}

// tr (a b)^(1/2) = tr (s b s)^(1/2) with s = a^(1/2): symmetric, so that no complex numbers come
// up.
Result<double> TraceOfRoot(const std::vector<double>& a, const std::vector<double>& b,
                           std::size_t n) {
  const auto of_a = SymmetricEigenpairs(a);
  if (!of_a) return InternalError("Frechet distance: no eigenvalues of a covariance were found");
  const std::vector<double> s = FunctionOf(*of_a, Root);
  const auto of_product = SymmetricEigenpairs(Product(Product(s, b, n), s, n));
  if (!of_product)
    return InternalError("Frechet distance: no eigenvalues of a product of covariances were found");
  double sum = 0;
  for (const double value : of_product->values) sum += Root(value);
  return sum;
}

double SquaredGap(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

double Kernel(std::span<const float> x, std::span<const float> y) {
  double dot = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    dot += static_cast<double>(x[i]) * static_cast<double>(y[i]);
  return std::pow(dot / static_cast<double>(x.size()) + 1, 3);
}

// Sum of the kernel over pairs of rows; of one set with itself, without the pairs of equal rows.
double KernelSum(const FeatureRows& a, const FeatureRows& b, const Workers& workers) {
  std::vector<double> sums(a.rows());
  workers.For(a.rows(), [&](std::size_t i, std::size_t) {
    for (std::size_t j = 0; j < b.rows(); ++j) {
      if (&a == &b && i == j) continue;
      sums[i] += Kernel(a.Row(i), b.Row(j));
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

struct Moments {
  std::vector<double> mean, deviation;  // by column
};

Moments ColumnMoments(const FeatureRows& rows) {
  const auto n = static_cast<double>(rows.rows());
  Moments out{std::vector<double>(rows.width), std::vector<double>(rows.width)};
  for (std::size_t i = 0; i < rows.rows(); ++i) {
    for (std::size_t c = 0; c < rows.width; ++c) out.mean[c] += rows.Row(i)[c] / n;
  }
  for (std::size_t i = 0; i < rows.rows(); ++i) {
    for (std::size_t c = 0; c < rows.width; ++c)
      out.deviation[c] += std::pow(rows.Row(i)[c] - out.mean[c], 2) / n;
  }
  for (double& d : out.deviation) d = std::sqrt(d);
  return out;
}

// A column whose numbers differ by their rounding only is constant.
bool IsConstant(double mean, double deviation) { return deviation <= 1e-6 * std::abs(mean); }

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

Result<double> FrechetDistance(const FeatureRows& a, const FeatureRows& b) {
  TILEGRAD_TRY(CheckPair(a, b, 2, "Frechet distance"));
  const NormalFit p = NormalFitOf(a), q = NormalFitOf(b);
  TILEGRAD_ASSIGN(const double root, TraceOfRoot(p.covariance, q.covariance, a.width));
  const double distance = SquaredGap(p.mean, q.mean) + Trace(p.covariance, a.width) +
                          Trace(q.covariance, a.width) - 2 * root;
  return std::max(distance, 0.0);
}

Result<double> KernelDistance(const FeatureRows& a, const FeatureRows& b, const Workers& workers) {
  TILEGRAD_TRY(CheckPair(a, b, 2, "kernel distance"));
  const auto m = static_cast<double>(a.rows()), n = static_cast<double>(b.rows());
  return KernelSum(a, a, workers) / (m * (m - 1)) + KernelSum(b, b, workers) / (n * (n - 1)) -
         2 * KernelSum(a, b, workers) / (m * n);
}

Status CheckRows(const FeatureRows& rows, std::size_t least, const char* what) {
  if (rows.width == 0 || rows.values.size() % rows.width != 0)
    return InvalidArgument("{}: {} values are no rows of {}", what, rows.values.size(), rows.width);
  if (rows.rows() < least)
    return InvalidArgument("{}: {} rows, but at least {} are needed", what, rows.rows(), least);
  const auto bad = std::find_if(rows.values.begin(), rows.values.end(),
                                [](float x) { return !std::isfinite(x); });
  if (bad == rows.values.end()) return {};
  const auto at = static_cast<std::size_t>(bad - rows.values.begin());
  return InvalidArgument("{}: row {}, column {} is not finite", what, at / rows.width,
                         at % rows.width);
}

FeatureRows DrawRows(const FeatureRows& from, std::size_t count, std::uint64_t seed) {
  std::vector<std::size_t> order(from.rows());
  std::iota(order.begin(), order.end(), std::size_t{0});
  Rng rng(seed);
  FeatureRows out{{}, from.width};
  for (std::size_t i = 0; i < std::min(count, order.size()); ++i) {
    std::swap(order[i], order[i + rng.Below(order.size() - i)]);
    const auto row = from.Row(order[i]);
    out.values.insert(out.values.end(), row.begin(), row.end());
  }
  return out;
}

FeatureRows SliceRows(const FeatureRows& from, std::size_t begin, std::size_t end) {
  const auto at = [&](std::size_t row) {
    return from.values.begin() + static_cast<std::ptrdiff_t>(row * from.width);
  };
  return {{at(begin), at(end)}, from.width};
}

FeatureRows Standardised(const FeatureRows& rows, const FeatureRows& reference) {
  const Moments moments = ColumnMoments(reference);
  FeatureRows out = rows;
  for (std::size_t i = 0; i < out.values.size(); ++i) {
    const double mean = moments.mean[i % out.width], deviation = moments.deviation[i % out.width];
    out.values[i] = IsConstant(mean, deviation)
                        ? 0.0f
                        : static_cast<float>((rows.values[i] - mean) / deviation);
  }
  return out;
}

}  // namespace tilegrad::train

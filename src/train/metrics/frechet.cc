// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/frechet.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "train/dense.h"

namespace tilegrad::train {
namespace {

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

}  // namespace

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

}  // namespace tilegrad::train

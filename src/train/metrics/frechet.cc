// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/frechet.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace tilegrad::train {
namespace {

struct NormalFit {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

NormalFit NormalFitOf(const FeatureRows& rows) {
  const auto n = static_cast<Eigen::Index>(rows.rows()), d = static_cast<Eigen::Index>(rows.width);
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::MatrixXd x = Eigen::Map<const RowMajor>(rows.values.data(), n, d).cast<double>();
  NormalFit out;
  out.mean = x.colwise().mean();
  x.rowwise() -= out.mean.transpose();
  out.covariance = x.transpose() * x / static_cast<double>(n - 1);
  return out;
}

// The eigenvalues of a covariance that rounding has left below 0 are 0.
Eigen::VectorXd Roots(const Eigen::VectorXd& eigenvalues) {
  return eigenvalues.cwiseMax(0.0).cwiseSqrt();
}

// tr (a b)^(1/2) = tr (s b s)^(1/2) with s = a^(1/2): symmetric, so that no complex numbers come
// up.
Result<double> TraceOfRoot(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_a(a);
  if (of_a.info() != Eigen::Success)
    return InternalError("Frechet distance: no eigenvalues of a covariance were found");
  const Eigen::MatrixXd s = of_a.eigenvectors() * Roots(of_a.eigenvalues()).asDiagonal() *
                            of_a.eigenvectors().transpose();
  const Eigen::MatrixXd product = s * b * s;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_product(
      0.5 * (product + product.transpose()), Eigen::EigenvaluesOnly);
  if (of_product.info() != Eigen::Success)
    return InternalError("Frechet distance: no eigenvalues of a product of covariances were found");
  return Roots(of_product.eigenvalues()).sum();
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
  TILEGRAD_ASSIGN(const double root, TraceOfRoot(p.covariance, q.covariance));
  const double distance =
      (p.mean - q.mean).squaredNorm() + p.covariance.trace() + q.covariance.trace() - 2 * root;
  return std::max(distance, 0.0);
}

Result<double> KernelDistance(const FeatureRows& a, const FeatureRows& b, const Workers& workers) {
  TILEGRAD_TRY(CheckPair(a, b, 2, "kernel distance"));
  const auto m = static_cast<double>(a.rows()), n = static_cast<double>(b.rows());
  return KernelSum(a, a, workers) / (m * (m - 1)) + KernelSum(b, b, workers) / (n * (n - 1)) -
         2 * KernelSum(a, b, workers) / (m * n);
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/dense.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace tilegrad::train {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::Map<const RowMajor> Square(std::span<const double> a, std::size_t n) {
  const auto size = static_cast<Eigen::Index>(n);
  return {a.data(), size, size};
}

}  // namespace

void NormalEquations::Add(std::span<const double> row, double value) {
  const std::size_t n = b.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) a[i * n + j] += row[i] * row[j];
    b[i] += row[i] * value;
  }
}

std::optional<std::vector<double>> NormalEquations::Solve() const {
  const Eigen::LLT<RowMajor> root(Square(a, b.size()));
  if (root.info() != Eigen::Success) return std::nullopt;
  std::vector<double> out = b;
  Eigen::Map<Eigen::VectorXd> x(out.data(), static_cast<Eigen::Index>(out.size()));
  root.solveInPlace(x);
  return out;
}

std::optional<Eigenpairs> SymmetricEigenpairs(std::span<const double> a) {
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(a.size()))));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> found(Square(a, n));
  if (found.info() != Eigen::Success) return std::nullopt;
  const auto& values = found.eigenvalues();
  const auto& columns = found.eigenvectors();
  return Eigenpairs{{values.data(), values.data() + n}, {columns.data(), columns.data() + n * n}};
}

std::vector<double> FunctionOf(const Eigenpairs& parts, double (*f)(double)) {
  const std::size_t n = parts.values.size();
  std::vector<double> out(n * n);
  for (std::size_t k = 0; k < n; ++k) {
    const double* const v = &parts.vectors[k * n];
    const double scale = f(parts.values[k]);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) out[i * n + j] += scale * v[i] * v[j];
  }
  return out;
}

std::vector<double> Product(std::span<const double> a, std::span<const double> b, std::size_t n) {
  std::vector<double> out(n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t j = 0; j < n; ++j) out[i * n + j] += a[i * n + k] * b[k * n + j];
  return out;
}

}  // namespace tilegrad::train

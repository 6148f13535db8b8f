// SPDX-License-Identifier: Apache-2.0
// Dense linear algebra in double precision, with Eigen. Matrices are square, n x n, row-major.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace tilegrad::train {

// Normal equations of a linear least-squares problem.
struct NormalEquations {
  explicit NormalEquations(std::size_t unknowns) : a(unknowns * unknowns), b(unknowns) {}

  // Adds (row . x - value)^2.
  void Add(std::span<const double> row, double value);
  // Cholesky; nullopt if `a` is not positive definite.
  std::optional<std::vector<double>> Solve() const;
  double& Diagonal(std::size_t i) { return a[i * (b.size() + 1)]; }

  std::vector<double> a, b;
};

// values ascending; row k of `vectors` is the unit eigenvector of values[k].
struct Eigenpairs {
  std::vector<double> values, vectors;
};
// The matrix is symmetric; reads its lower triangle. nullopt if the iteration does not converge
// (NaN).
std::optional<Eigenpairs> SymmetricEigenpairs(std::span<const double> a);

// sum over k of f(values[k]) v_k v_k^T.
std::vector<double> FunctionOf(const Eigenpairs& parts, double (*f)(double));

std::vector<double> Product(std::span<const double> a, std::span<const double> b, std::size_t n);

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "fit/diffusion.h"

#include <Eigen/SparseCholesky>
#include <cstddef>
#include <vector>

namespace tilegrad::train {

// Cholesky's factor of 1 + lambda L, whose rows are ordered so that it stays sparse.
struct Diffusion::System {
  System(const Topology& topology, double lambda) {
    const auto count = static_cast<int>(topology.offsets.size()) - 1;
    std::vector<Eigen::Triplet<double>> entries;
    for (int v = 0; v < count; ++v) {
      const auto* const range = &topology.offsets[static_cast<std::size_t>(v)];
      entries.emplace_back(v, v, 1 + lambda * (range[1] - range[0]));
      for (std::int32_t n = range[0]; n < range[1]; ++n)
        entries.emplace_back(v, topology.neighbors[static_cast<std::size_t>(n)], -lambda);
    }
    Eigen::SparseMatrix<double> matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor.compute(matrix);
    rows.resize(count, 3);
  }

  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor;
  Eigen::MatrixX3d rows;  // right sides, in the factor's order, then solutions
};

Diffusion::Diffusion(const Topology& topology, double lambda)
    : topology_(&topology), lambda_(lambda) {}
Diffusion::~Diffusion() = default;

void Diffusion::Apply(std::span<float> x) {
  if (lambda_ == 0) return;
  if (!system_) system_ = std::make_unique<System>(*topology_, lambda_);
  auto& [factor, rows] = *system_;
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>> vertices(x.data(),
                                                                                rows.rows(), 3);
  const auto& order = factor.permutationP().indices();
  for (Eigen::Index v = 0; v < rows.rows(); ++v)
    rows.row(order[v]) = vertices.row(v).cast<double>();
  factor.matrixL().solveInPlace(rows);
  factor.matrixU().solveInPlace(rows);
  for (Eigen::Index v = 0; v < rows.rows(); ++v) vertices.row(v) = rows.row(order[v]).cast<float>();
}

}  // namespace tilegrad::train

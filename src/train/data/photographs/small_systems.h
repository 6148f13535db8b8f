// SPDX-License-Identifier: Apache-2.0
// Linear algebra of a few unknowns.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace tilegrad::train {

template <std::size_t N>
using Matrix = std::array<std::array<double, N>, N>;
template <std::size_t N>
using Vector = std::array<double, N>;

// a += weight v v^T
template <std::size_t N>
void AddOuter(const Vector<N>& v, double weight, Matrix<N>* a) {
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j) (*a)[i][j] += weight * v[i] * v[j];
}

// x of a x = b with a symmetric and positive definite, by Cholesky; zeros where it is not.
template <std::size_t N>
Vector<N> SolvePositive(Matrix<N> a, Vector<N> b) {
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = a[i][j];
      for (std::size_t k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
      if (i == j && !(sum > 0)) return {};
      a[i][j] = i == j ? std::sqrt(sum) : sum / a[j][j];
    }
    for (std::size_t k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  for (std::size_t i = N; i-- > 0;) {
    for (std::size_t k = i + 1; k < N; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
  return b;
}

// a = vectors diag(values) vectors^T of a symmetric a, by Jacobi's rotations; columns are the
// vectors.
template <std::size_t N>
void Eigen(Matrix<N> a, Vector<N>* values, Matrix<N>* vectors) {
  *vectors = {};
  for (std::size_t i = 0; i < N; ++i) (*vectors)[i][i] = 1;
  for (int sweep = 0; sweep < 50; ++sweep) {
    for (std::size_t p = 0; p < N; ++p) {
      for (std::size_t q = p + 1; q < N; ++q) {
        if (a[p][q] == 0) continue;
        const double angle = 0.5 * std::atan2(2 * a[p][q], a[q][q] - a[p][p]);
        const double c = std::cos(angle), s = std::sin(angle);
        for (std::size_t k = 0; k < N; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq, a[k][q] = s * kp + c * kq;
          const double vp = (*vectors)[k][p], vq = (*vectors)[k][q];
          (*vectors)[k][p] = c * vp - s * vq, (*vectors)[k][q] = s * vp + c * vq;
        }
        for (std::size_t k = 0; k < N; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk, a[q][k] = s * pk + c * qk;
        }
      }
    }
  }
  for (std::size_t i = 0; i < N; ++i) (*values)[i] = a[i][i];
}

}  // namespace tilegrad::train

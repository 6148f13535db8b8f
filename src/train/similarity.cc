// SPDX-License-Identifier: Apache-2.0
#include "train/similarity.h"

#include <algorithm>

#include "scene/weak_perspective_ref.h"
#include "train/dense.h"
#include "train/points3.h"

namespace tilegrad::train {
namespace {

using points3::Dot, points3::Point, points3::operator+, points3::operator-, points3::operator*;

Point MeanOf(std::span<const Point> points) {
  Point sum{};
  for (const Point& p : points) sum = sum + p;
  return (1 / static_cast<double>(points.size())) * sum;
}

}  // namespace

Point Similarity::operator()(const Point& p) const {
  return scale * weak_ref::Rotate(rotation, p) + offset;
}

// The quaternion is the eigenvector of the largest eigenvalue of a symmetric matrix.
std::array<double, 9> NearestRotation(const std::array<double, 9>& m) {
  const double trace = m[0] + m[4] + m[8];
  std::array<double, 16> k{};
  k[0] = trace;
  const double turn[3] = {m[7] - m[5], m[2] - m[6], m[3] - m[1]};
  for (std::size_t i = 0; i < 3; ++i) {
    k[i + 1] = k[4 * (i + 1)] = turn[i];
    for (std::size_t j = 0; j < 3; ++j)
      k[4 * (i + 1) + j + 1] = m[3 * i + j] + m[3 * j + i] - (i == j ? trace : 0);
  }
  const bool any = std::ranges::any_of(k, [](double x) { return x != 0; });
  const auto parts = any ? SymmetricEigenpairs(k) : std::nullopt;
  if (!parts) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double* const q = &parts->vectors[12];
  return RotationOf(std::array{q[0], q[1], q[2], q[3]});
}

Similarity FitSimilarity(const std::array<double, 9>& rotation, std::span<const Point> from,
                         std::span<const Point> to) {
  Similarity out{.rotation = rotation};
  const Point from_mean = MeanOf(from);
  const Point to_mean = MeanOf(to);
  double along = 0;
  double squares = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Point a = weak_ref::Rotate(rotation, from[i] - from_mean);
    along += Dot(a, to[i] - to_mean);
    squares += Dot(a, a);
  }
  if (squares > 0 && along > 0) out.scale = along / squares;
  out.offset = to_mean - out.scale * weak_ref::Rotate(rotation, from_mean);
  return out;
}

Similarity FitSimilarity(std::span<const Point> from, std::span<const Point> to) {
  const Point from_mean = MeanOf(from);
  const Point to_mean = MeanOf(to);
  std::array<double, 9> m{};
  for (std::size_t k = 0; k < from.size(); ++k) {
    const Point a = from[k] - from_mean;
    const Point b = to[k] - to_mean;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) m[3 * i + j] += b[i] * a[j];
  }
  return FitSimilarity(NearestRotation(m), from, to);
}

}  // namespace tilegrad::train

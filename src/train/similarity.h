// SPDX-License-Identifier: Apache-2.0
// Rotation, scale and offset between two frames, in least squares.
#pragma once

#include <array>
#include <span>

namespace tilegrad::train {

// p' = scale * rotation * p + offset.
struct Similarity {
  double scale = 1;
  std::array<double, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major
  std::array<double, 3> offset = {0, 0, 0};

  std::array<double, 3> operator()(const std::array<double, 3>& p) const;
};

// The rotation R with the largest trace(R^T m), m row-major (B. Horn, JOSA A 4, 1987). Always a
// rotation, also where the orthogonal matrix nearest to m is a reflection; the identity for m = 0.
std::array<double, 9> NearestRotation(const std::array<double, 9>& m);

// Least-squares scale and offset that map the rotated points `from` to `to`, of equal count; scale
// 1 where they determine no positive one.
Similarity FitSimilarity(const std::array<double, 9>& rotation,
                         std::span<const std::array<double, 3>> from,
                         std::span<const std::array<double, 3>> to);
// The same with the best rotation.
Similarity FitSimilarity(std::span<const std::array<double, 3>> from,
                         std::span<const std::array<double, 3>> to);

}  // namespace tilegrad::train

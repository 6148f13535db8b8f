// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/distance_barrier.h"

#include <cmath>
#include <cstddef>

namespace tilegrad::train {
namespace {

constexpr double kFar = 1e12, kSteepness = 50;

// The lower envelope of parabolas f[q] + (x - q)^2 along a line of `n` numbers with a stride.
void TransformLine(double* f, std::size_t n, std::size_t stride) {
  std::vector<double> in(n), edges(n + 1);
  std::vector<std::size_t> tops(n);
  for (std::size_t q = 0; q < n; ++q) in[q] = f[q * stride];
  std::size_t last = 0;
  edges[0] = -kFar;
  edges[1] = kFar;
  for (std::size_t q = 1; q < n; ++q) {
    const auto meet = [&](std::size_t p) {
      const auto x = static_cast<double>(q), y = static_cast<double>(p);
      return (in[q] + x * x - in[p] - y * y) / (2 * (x - y));
    };
    double at = meet(tops[last]);
    while (last > 0 && at <= edges[last]) at = meet(tops[--last]);
    tops[++last] = q;
    edges[last] = at;
    edges[last + 1] = kFar;
  }
  std::size_t k = 0;
  for (std::size_t q = 0; q < n; ++q) {
    while (edges[k + 1] < static_cast<double>(q)) ++k;
    const double d = static_cast<double>(q) - static_cast<double>(tops[k]);
    f[q * stride] = d * d + in[tops[k]];
  }
}

}  // namespace

std::vector<double> SquaredDistances(std::span<const float> mask, int size, bool inside) {
  std::vector<double> out(mask.size());
  for (std::size_t i = 0; i < mask.size(); ++i) out[i] = (mask[i] >= 0.5f) == inside ? 0 : 1e9;
  const auto n = static_cast<std::size_t>(size);
  for (std::size_t x = 0; x < n; ++x) TransformLine(&out[x], n, n);
  for (std::size_t y = 0; y < n; ++y) TransformLine(&out[y * n], n, 1);
  return out;
}

void DistanceBarrier(std::span<const float> mask, int size, std::span<float> out) {
  const std::vector<double> to_object = SquaredDistances(mask, size, true),
                            to_rest = SquaredDistances(mask, size, false);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const double d = (std::sqrt(to_object[i]) - std::sqrt(to_rest[i])) / size;
    out[i] = static_cast<float>(1 / (1 + std::exp(-kSteepness * d)));
  }
}

}  // namespace tilegrad::train

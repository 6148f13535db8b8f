// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/feature_rows.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"

namespace tilegrad::train {
namespace {

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

Status CheckPair(const FeatureRows& a, const FeatureRows& b, std::size_t least, const char* what) {
  TILEGRAD_TRY(CheckRows(a, least, what));
  TILEGRAD_TRY(CheckRows(b, least, what));
  if (a.width == b.width) return {};
  return InvalidArgument("{}: rows of {} columns beside rows of {}", what, a.width, b.width);
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

double SquaredDistance(std::span<const float> a, std::span<const float> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += d * d;
  }
  return sum;
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/eval/standard_error.h"

#include <cmath>
#include <numeric>

#include "train/eval/measures.h"

namespace tilegrad::train {
namespace {

std::vector<std::vector<double>> NumbersOf(std::span<const std::vector<Score>> classes,
                                           const ScoreMeasure& measure) {
  std::vector<std::vector<double>> out(classes.size());
  for (std::size_t c = 0; c < classes.size(); ++c) {
    for (const Score& score : classes[c]) {
      if (const auto number = measure.Of(score)) out[c].push_back(*number);
    }
  }
  return out;
}

}  // namespace

ClassedMean MeanOverClasses(std::span<const std::vector<double>> classes) {
  double means = 0, squares = 0, shares = 0;
  std::size_t count = 0, freedom = 0;
  for (const std::vector<double>& numbers : classes) {
    if (numbers.empty()) continue;
    const auto n = static_cast<double>(numbers.size());
    const double mean = std::accumulate(numbers.begin(), numbers.end(), 0.0) / n;
    for (const double x : numbers) squares += (x - mean) * (x - mean);
    means += mean;
    shares += 1 / n;
    freedom += numbers.size() - 1;
    ++count;
  }
  if (count == 0) return {};
  const auto c = static_cast<double>(count);
  if (freedom == 0) return {means / c, std::nullopt};
  return {means / c, std::sqrt(squares / static_cast<double>(freedom) * shares) / c};
}

std::optional<Score> StandardErrors(std::span<const std::vector<Score>> classes) {
  Score out;
  for (const ScoreMeasure& measure : kMeasures) {
    const auto error = MeanOverClasses(NumbersOf(classes, measure)).error;
    if (!error && measure.value == nullptr) return std::nullopt;
    measure.Set(error, &out);
  }
  return out;
}

}  // namespace tilegrad::train

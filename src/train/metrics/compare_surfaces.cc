// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "train/metrics/metrics.h"
#include "train/metrics/nearest_point.h"

namespace tilegrad::train {
namespace {

struct OneWay {
  double mean = 0, share = 0;  // of the distances; within the threshold
};

OneWay Measure(std::span<const glm::vec3> from, const NearestPoint& to, double threshold) {
  OneWay out;
  for (const glm::vec3& point : from) {
    const double distance = std::sqrt(to.Find(glm::dvec3(point)).squared);
    out.mean += distance;
    out.share += distance <= threshold;
  }
  const double n = static_cast<double>(from.size());
  return {out.mean / n, out.share / n};
}

}  // namespace

SurfaceScore CompareSurfaces(std::span<const glm::vec3> predicted, std::span<const glm::vec3> truth,
                             double threshold) {
  if (predicted.empty() || truth.empty()) return {};
  const OneWay forth = Measure(predicted, NearestPoint(truth), threshold);
  const OneWay back = Measure(truth, NearestPoint(predicted), threshold);
  const double sum = forth.share + back.share;
  return {.chamfer = 0.5 * (forth.mean + back.mean),
          .precision = forth.share,
          .recall = back.share,
          .f_score = sum > 0 ? 2 * forth.share * back.share / sum : 0};
}

}  // namespace tilegrad::train

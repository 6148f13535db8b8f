// SPDX-License-Identifier: Apache-2.0
// PCK: the percentage of correct keypoints, as CMR counts it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace tilegrad::train {

// An error is right if it is below `threshold`, in parts of the longer side of the object's box.
class KeypointScore {
 public:
  KeypointScore(std::size_t keypoints, double threshold)
      : threshold_(threshold), right_(keypoints), seen_(keypoints) {}
  // A visible keypoint.
  void Add(std::size_t keypoint, double error) {
    ++seen_[keypoint];
    right_[keypoint] += error < threshold_ ? 1 : 0;
  }
  // The share that is right of each keypoint, and the mean of those over the keypoints that were
  // seen; nothing if none was.
  std::optional<double> Mean() const {
    double sum = 0, count = 0;
    for (std::size_t k = 0; k < seen_.size(); ++k) {
      if (seen_[k] == 0) continue;
      sum += static_cast<double>(right_[k]) / static_cast<double>(seen_[k]);
      count += 1;
    }
    return count > 0 ? std::optional(sum / count) : std::nullopt;
  }

 private:
  double threshold_;
  std::vector<std::int64_t> right_, seen_;
};

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
// Where gradients lie in one long vector, and how it is cut into buckets, which travel by
// themselves.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace tilegrad::train {

struct Range {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
};

class BucketLayout {
 public:
  // The last parameter comes first: a backward pass is done with it first. `tail` numbers stand
  // behind all. Buckets have `bucket` numbers, the last one what is left: a large parameter lies in
  // several, so that its sum need not wait for all of it.
  void Reset(std::span<const std::size_t> sizes, std::size_t tail, std::size_t bucket);

  std::size_t total() const { return tail_.end; }
  std::size_t parameters() const { return parameters_.size(); }
  Range parameter(std::size_t i) const { return parameters_[i]; }
  Range tail() const { return tail_; }
  std::size_t buckets() const { return parts_.size(); }
  Range bucket(std::size_t b) const { return {b * bucket_, std::min((b + 1) * bucket_, total())}; }
  // Those that hold some of a parameter, or of the tail.
  Range BucketsOf(const Range& part) const {
    if (part.size() == 0) return {};
    return {part.begin / bucket_, (part.end - 1) / bucket_ + 1};
  }
  // How many of these a bucket holds.
  std::size_t parts(std::size_t b) const { return parts_[b]; }

 private:
  std::vector<Range> parameters_;
  std::vector<std::size_t> parts_;
  Range tail_;
  std::size_t bucket_ = 1;
};

// The share of a bucket that a rank finishes the sum of.
inline Range PieceOf(const Range& bucket, int rank, int ranks) {
  const auto r = static_cast<std::size_t>(rank), n = static_cast<std::size_t>(ranks);
  return {bucket.begin + r * bucket.size() / n, bucket.begin + (r + 1) * bucket.size() / n};
}

}  // namespace tilegrad::train

// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/division.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kMostBuckets = 4000;  // Address::number counts them

}  // namespace

std::vector<Subtree> SubtreesOf(int ranks, std::int64_t portions) {
  std::vector<Subtree> out;
  for (int rank = 0; rank < ranks; ++rank) {
    const std::int64_t end = (rank + 1) * portions / ranks;
    for (std::int64_t at = rank * portions / ranks; at < end; at += out.back().count) {
      std::int64_t count = 1;
      while (at % (2 * count) == 0 && at + 2 * count <= end) count *= 2;
      out.push_back({at, count, rank});
    }
  }
  return out;
}

void BucketLayout::Reset(std::span<const std::size_t> sizes, std::size_t tail, std::size_t bucket) {
  parameters_.resize(sizes.size());
  std::size_t at = 0;
  for (std::size_t i = sizes.size(); i-- > 0;) {
    parameters_[i] = {at, at + sizes[i]};
    at += sizes[i];
  }
  tail_ = {at, at + tail};
  bucket_ = std::max(bucket, total() / kMostBuckets + 1);
  parts_.assign((total() + bucket_ - 1) / bucket_, 0);
  const auto count = [&](const Range& part) {
    const Range held = BucketsOf(part);
    for (std::size_t b = held.begin; b < held.end; ++b) ++parts_[b];
  };
  for (const Range& parameter : parameters_) count(parameter);
  count(tail_);
}

}  // namespace tilegrad::train

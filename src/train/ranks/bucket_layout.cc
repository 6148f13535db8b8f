// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/bucket_layout.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kMostBuckets = 4000;  // Address::number counts them

}  // namespace

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

// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/bucket_layout.h"

namespace tilegrad::train {

void BucketLayout::Reset(std::span<const std::size_t> sizes, std::size_t tail, std::size_t bucket) {
  parameters_.resize(sizes.size()), bucket_of_.resize(sizes.size());
  buckets_.assign(1, {}), parts_.assign(1, 0);
  std::size_t at = 0;
  for (std::size_t i = sizes.size(); i-- > 0;) {
    if (buckets_.back().size() >= bucket) buckets_.push_back({at, at}), parts_.push_back(0);
    parameters_[i] = {at, at + sizes[i]};
    at += sizes[i];
    buckets_.back().end = at;
    ++parts_.back();
    bucket_of_[i] = buckets_.size() - 1;
  }
  tail_ = {at, at + tail};
  buckets_.back().end = tail_.end;
  ++parts_.back();
}

}  // namespace tilegrad::train

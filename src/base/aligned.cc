// SPDX-License-Identifier: Apache-2.0
#include "base/aligned.h"

#include <algorithm>

namespace tilegrad {

void* Arena::AllocateBytes(std::size_t bytes) {
  bytes = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  if (blocks_.empty() || used_ + bytes > blocks_.back().size()) {
    blocks_.emplace_back(std::max(bytes, std::max<std::size_t>(capacity(), 64 * 1024)));
    used_ = 0;
  }
  std::byte* p = blocks_.back().data() + used_;
  used_ += bytes;
  return p;
}

void Arena::Reset() {
  if (blocks_.size() > 1) {
    const std::size_t total = capacity();
    blocks_.clear();
    blocks_.emplace_back(total);
  }
  used_ = 0;
}

std::size_t Arena::capacity() const {
  std::size_t total = 0;
  for (const auto& block : blocks_) total += block.size();
  return total;
}

}  // namespace tilegrad

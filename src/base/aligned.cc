// SPDX-License-Identifier: Apache-2.0
#include "base/aligned.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>

namespace tilegrad {
namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;

std::align_val_t AlignmentOf(std::size_t bytes) {
  return std::align_val_t(bytes >= kHugePage ? kHugePage : kAlignment);
}

}  // namespace

void* AllocateAligned(std::size_t bytes) {
  void* data = ::operator new(bytes, AlignmentOf(bytes));
  // Advice only: if the system ignores it, only speed suffers.
  if (bytes >= kHugePage) madvise(data, bytes, MADV_HUGEPAGE);
  return data;
}

void FreeAligned(void* data, std::size_t bytes) { ::operator delete(data, AlignmentOf(bytes)); }

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

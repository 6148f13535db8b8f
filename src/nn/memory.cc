// SPDX-License-Identifier: Apache-2.0
#include "nn/memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <mutex>
#include <new>
#include <utility>

#include "base/aligned.h"
#include "nn/step_memory.h"

namespace tilegrad::nn {

struct Block {
  std::byte* data = nullptr;
  std::size_t bytes = 0;
  std::size_t size_class = 0;
  std::atomic<std::size_t> owners{0};
  std::shared_ptr<MemoryPool> pool;  // set while the block is live: keeps the pool for its return
};

namespace {

constexpr std::size_t kSteps = 8;  // classes to each doubling
constexpr std::size_t kClasses = 64 * kSteps;
constexpr std::size_t kSmallest = 1024;  // bytes; whatever is smaller shares one class

struct SizeClass {
  std::size_t index, bytes;
};

SizeClass ClassOf(std::size_t bytes) {
  bytes = std::max(bytes, kSmallest);
  const int log2 = std::bit_width(bytes) - 1;
  const std::size_t step = (std::size_t{1} << log2) / kSteps;
  const std::size_t rounded = (bytes + step - 1) / step * step;
  return {static_cast<std::size_t>(log2) * kSteps + rounded / step - kSteps, rounded};
}

// Large blocks ask for huge pages: fewer page faults at the start, fewer TLB misses in every pass
// over weights and activations.
constexpr std::size_t kHugePage = std::size_t{2} << 20;

std::align_val_t AlignmentOf(std::size_t bytes) {
  return std::align_val_t(bytes >= 2 * kHugePage ? kHugePage : kAlignment);
}

Block* New(const SizeClass& size) {
  auto* block = new Block;
  block->data = static_cast<std::byte*>(::operator new(size.bytes, AlignmentOf(size.bytes)));
  block->bytes = size.bytes;
  block->size_class = size.index;
  // Advice only: where the system does not follow it, nothing changes but speed.
  if (size.bytes >= 2 * kHugePage) madvise(block->data, size.bytes, MADV_HUGEPAGE);
  return block;
}

void Delete(Block* block) {
  ::operator delete(block->data, AlignmentOf(block->bytes));
  delete block;
}

}  // namespace

struct MemoryPool::State {
  mutable std::mutex mutex;
  std::array<std::vector<Block*>, kClasses> free;
  MemoryStats stats;
};

BlockRef::BlockRef(const BlockRef& other) : block_(other.block_) {
  if (block_ != nullptr) block_->owners.fetch_add(1, std::memory_order_relaxed);
}

BlockRef::~BlockRef() {
  if (block_ == nullptr || block_->owners.fetch_sub(1, std::memory_order_acq_rel) != 1) return;
  const std::shared_ptr<MemoryPool> pool = std::move(block_->pool);
  pool->Release(block_);
}

std::byte* BlockRef::data() const { return block_ == nullptr ? nullptr : block_->data; }

bool BlockRef::unique() const {
  return block_ != nullptr && block_->owners.load(std::memory_order_acquire) == 1;
}

MemoryPool::MemoryPool() : state_(std::make_unique<State>()) {}

MemoryPool::~MemoryPool() { Trim(); }

std::shared_ptr<MemoryPool> MemoryPool::Make() {
  return std::shared_ptr<MemoryPool>(new MemoryPool());
}

BlockRef MemoryPool::Allocate(std::size_t bytes) {
  const SizeClass wanted = ClassOf(bytes);
  const std::lock_guard lock(state_->mutex);
  auto& free = state_->free[wanted.index];
  MemoryStats& stats = state_->stats;
  ++stats.requests;
  Block* block = nullptr;
  if (free.empty()) {
    ++stats.misses;
    stats.held_bytes += wanted.bytes;
    block = New(wanted);
  } else {
    block = free.back();
    free.pop_back();
  }
  stats.live_bytes += block->bytes;
  stats.peak_bytes = std::max(stats.peak_bytes, stats.live_bytes);
  block->pool = shared_from_this();
  block->owners.store(1, std::memory_order_relaxed);
  return BlockRef(block);
}

void MemoryPool::Release(Block* block) {
  const std::lock_guard lock(state_->mutex);
  state_->stats.live_bytes -= block->bytes;
  state_->free[block->size_class].push_back(block);
}

void MemoryPool::Trim() {
  const std::lock_guard lock(state_->mutex);
  for (auto& free : state_->free) {
    for (Block* block : free) {
      state_->stats.held_bytes -= block->bytes;
      Delete(block);
    }
    free.clear();
  }
}

void MemoryPool::ResetPeak() {
  const std::lock_guard lock(state_->mutex);
  state_->stats.peak_bytes = state_->stats.live_bytes;
}

MemoryStats MemoryPool::stats() const {
  const std::lock_guard lock(state_->mutex);
  return state_->stats;
}

std::shared_ptr<std::pmr::memory_resource> MakeStepMemory() {
  // Larger blocks, of which a step has none, would go to the heap each time.
  constexpr std::size_t kLargestBlock = std::size_t{1} << 20;
  return std::make_shared<std::pmr::unsynchronized_pool_resource>(std::pmr::pool_options{
      .max_blocks_per_chunk = 0, .largest_required_pool_block = kLargestBlock});
}

}  // namespace tilegrad::nn

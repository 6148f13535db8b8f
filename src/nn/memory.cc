// SPDX-License-Identifier: Apache-2.0
#include "nn/memory.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "nn/address_arena.h"

namespace tilegrad::nn {

struct Block {
  std::byte* data = nullptr;
  std::size_t bytes = 0;
  std::atomic<std::size_t> owners{0};
  std::shared_ptr<MemoryPool> pool;  // set while the block is live: keeps the pool for its return
};

struct MemoryPool::State {
  // Small tensors use a separate arena, so that they do not fragment that of large ones.
  AddressArena& ArenaOf(std::size_t bytes) {
    constexpr std::size_t kLarge = std::size_t{256} << 10;
    return bytes < kLarge ? small : large;
  }

  mutable std::mutex mutex;
  AddressArena small, large;
  std::vector<std::unique_ptr<Block>> blocks;  // all that were made
  std::vector<Block*> unused;
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

MemoryPool::~MemoryPool() = default;

std::shared_ptr<MemoryPool> MemoryPool::Make() {
  return std::shared_ptr<MemoryPool>(new MemoryPool());
}

BlockRef MemoryPool::Allocate(std::size_t bytes) {
  const std::lock_guard lock(state_->mutex);
  MemoryStats& stats = state_->stats;
  ++stats.requests;
  if (state_->unused.empty()) {
    state_->unused.push_back(state_->blocks.emplace_back(std::make_unique<Block>()).get());
    state_->unused.reserve(state_->blocks.size());
  }
  Block* block = state_->unused.back();
  block->data = state_->ArenaOf(bytes).Allocate(bytes);  // or throws
  state_->unused.pop_back();
  block->bytes = bytes;
  stats.live_bytes += AddressArena::Rounded(bytes);
  stats.peak_bytes = std::max(stats.peak_bytes, stats.live_bytes);
  block->pool = shared_from_this();
  block->owners.store(1, std::memory_order_relaxed);
  return BlockRef(block);
}

void MemoryPool::Release(Block* block) {
  const std::lock_guard lock(state_->mutex);
  state_->stats.live_bytes -= AddressArena::Rounded(block->bytes);
  state_->ArenaOf(block->bytes).Free(block->data, block->bytes);
  state_->unused.push_back(block);
}

void MemoryPool::Trim() {
  const std::lock_guard lock(state_->mutex);
  state_->small.Trim();
  state_->large.Trim();
}

void MemoryPool::ResetPeak() {
  const std::lock_guard lock(state_->mutex);
  state_->stats.peak_bytes = state_->stats.live_bytes;
}

MemoryStats MemoryPool::stats() const {
  const std::lock_guard lock(state_->mutex);
  MemoryStats stats = state_->stats;
  stats.held_bytes = state_->small.held() + state_->large.held();
  stats.misses = state_->small.growths() + state_->large.growths();
  return stats;
}

std::shared_ptr<std::pmr::memory_resource> MakeStepMemory() {
  // Larger blocks, of which a step has none, would go to the heap each time.
  constexpr std::size_t kLargestBlock = std::size_t{1} << 20;
  return std::make_shared<std::pmr::unsynchronized_pool_resource>(std::pmr::pool_options{
      .max_blocks_per_chunk = 0, .largest_required_pool_block = kLargestBlock});
}

}  // namespace tilegrad::nn

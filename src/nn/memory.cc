// SPDX-License-Identifier: Apache-2.0
#include "nn/memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <iterator>
#include <mutex>
#include <new>

#if __has_include(<sanitizer/asan_interface.h>)
#include <sanitizer/asan_interface.h>  // macros that are empty without AddressSanitizer
#else
#define ASAN_POISON_MEMORY_REGION(data, bytes) static_cast<void>(data)
#define ASAN_UNPOISON_MEMORY_REGION(data, bytes) static_cast<void>(data)
#endif

#include "base/aligned.h"

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

namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;
// Address space is plentiful and free until used. If a limit forbids this much, smaller ranges are
// tried, down to this.
constexpr std::size_t kMostAddresses = std::size_t{64} << 30;
constexpr std::size_t kFewestAddresses = std::size_t{64} << 20;

std::size_t RoundUpTo(std::size_t bytes, std::size_t step) {
  return (bytes + step - 1) / step * step;
}

// Addresses without memory.
void* Reserve(std::size_t bytes) {
  return mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
}

}  // namespace

std::size_t AddressArena::Rounded(std::size_t bytes) {
  // Large ranges are rounded to whole pages, so that fewer remainders are left.
  constexpr std::size_t kLarge = std::size_t{1} << 18, kPage = 4096;
  return RoundUpTo(std::max<std::size_t>(bytes, 1), bytes >= kLarge ? kPage : kAlignment);
}

AddressArena::~AddressArena() {
  for (const Region& region : regions_) {
    ASAN_UNPOISON_MEMORY_REGION(region.begin, region.usable);
    munmap(region.begin, region.reserved);
  }
}

AddressArena::FreeRanges::iterator AddressArena::BestFit(std::size_t size) {
  auto best = free_.end();
  for (auto it = free_.begin(); it != free_.end(); ++it) {
    if (it->second >= size && (best == free_.end() || it->second < best->second)) best = it;
  }
  return best;
}

std::byte* AddressArena::Allocate(std::size_t bytes) {
  const std::size_t size = Rounded(bytes);
  std::byte* data = nullptr;
  if (const auto fit = BestFit(size); fit != free_.end()) {
    data = fit->first;
    const std::size_t rest = fit->second - size;
    free_.erase(fit);
    if (rest > 0) free_.emplace(data + size, rest);
  } else {
    data = Grow(size);
  }
  ASAN_UNPOISON_MEMORY_REGION(data, bytes);
  return data;
}

// Takes the free space at the end of the last region, plus as much as is missing.
std::byte* AddressArena::Grow(std::size_t size) {
  ++growths_;
  if (regions_.empty() || regions_.back().reserved - regions_.back().used < size) AddRegion(size);
  Region& region = regions_.back();
  std::byte* const end = region.begin + region.used;
  std::byte* begin = end;
  auto joined = free_.end();
  if (const auto after = free_.lower_bound(end); after != free_.begin()) {
    const auto last = std::prev(after);
    if (last->first >= region.begin && last->first + last->second == end) {
      begin = last->first;
      joined = last;
    }
  }
  const std::size_t more = size - static_cast<std::size_t>(end - begin);
  if (region.used + more > region.usable) {
    const std::size_t usable = std::min(RoundUpTo(region.used + more, kHugePage), region.reserved);
    if (mprotect(region.begin, usable, PROT_READ | PROT_WRITE) != 0) throw std::bad_alloc();
    ASAN_POISON_MEMORY_REGION(region.begin + region.usable, usable - region.usable);
    region.usable = usable;
  }
  // From here on nothing fails.
  if (joined != free_.end()) free_.erase(joined);
  region.used += more;
  held_ += more;
  return begin;
}

void AddressArena::AddRegion(std::size_t bytes) {
  std::size_t size = std::max(kMostAddresses, RoundUpTo(bytes, kHugePage));
  void* memory = Reserve(size);
  while (memory == MAP_FAILED && size / 2 >= std::max(bytes, kFewestAddresses)) {
    size /= 2;
    memory = Reserve(size);
  }
  if (memory == MAP_FAILED) throw std::bad_alloc();
  // Fewer page faults at the start, fewer TLB misses in every pass over weights and activations.
  // Advice only: if the system ignores it, only speed suffers.
  madvise(memory, size, MADV_HUGEPAGE);
  regions_.push_back({static_cast<std::byte*>(memory), size, 0, 0});
}

void AddressArena::Free(std::byte* data, std::size_t bytes) {
  bytes = Rounded(bytes);
  ASAN_POISON_MEMORY_REGION(data, bytes);
  auto next = free_.lower_bound(data);
  if (next != free_.end() && data + bytes == next->first) {
    bytes += next->second;
    next = free_.erase(next);
  }
  if (next != free_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == data) {
      before->second += bytes;
      return;
    }
  }
  free_.emplace_hint(next, data, bytes);
}

void AddressArena::Trim() {
  for (const auto& [data, size] : free_) {
    const auto address = reinterpret_cast<std::uintptr_t>(data);
    const std::size_t begin = RoundUpTo(address, kHugePage);
    const std::size_t end = (address + size) / kHugePage * kHugePage;
    if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);
  }
}

}  // namespace tilegrad::nn

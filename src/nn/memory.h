// SPDX-License-Identifier: Apache-2.0
// Memory of tensors: reference-counted blocks that return to a pool, so that a training step with
// the same sizes as the one before allocates nothing from the heap.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <memory_resource>
#include <utility>
#include <vector>

namespace tilegrad::nn {

struct MemoryStats {
  std::size_t live_bytes = 0;  // in blocks that tensors hold now
  std::size_t peak_bytes = 0;  // the largest live_bytes since the start or ResetPeak()
  std::size_t held_bytes = 0;  // ever used by live blocks: taken from the system
  std::size_t misses = 0;      // requests that made held_bytes grow
  std::size_t requests = 0;
};

struct Block;

// Shared ownership of one block; the last owner returns it to its pool.
class BlockRef {
 public:
  BlockRef() = default;
  explicit BlockRef(Block* block) : block_(block) {}  // takes over one reference
  BlockRef(const BlockRef& other);
  BlockRef(BlockRef&& other) noexcept : block_(std::exchange(other.block_, nullptr)) {}
  BlockRef& operator=(BlockRef other) noexcept {
    std::swap(block_, other.block_);
    return *this;
  }
  ~BlockRef();

  std::byte* data() const;
  bool unique() const;  // whether this is the only owner
  explicit operator bool() const { return block_ != nullptr; }

 private:
  Block* block_ = nullptr;
};

// Blocks are ranges of one arena (memory.h): when a sequence of requests repeats, its second
// or third round has no misses. Thread-safe. Blocks may outlive every other owner of the pool.
class MemoryPool : public std::enable_shared_from_this<MemoryPool> {
 public:
  static std::shared_ptr<MemoryPool> Make();
  ~MemoryPool();
  MemoryPool(const MemoryPool&) = delete;
  MemoryPool& operator=(const MemoryPool&) = delete;

  // Uninitialised, aligned to kAlignment, at least `bytes` long.
  BlockRef Allocate(std::size_t bytes);
  void Trim();  // returns free memory to the system
  void ResetPeak();
  MemoryStats stats() const;

 private:
  friend class BlockRef;
  MemoryPool();
  void Release(Block* block);
  struct State;
  std::unique_ptr<State> state_;
};

// Memory for the small objects that every training step creates and drops: graph nodes, lists of
// Vars. It returns to a pool, so that a step with the same sizes as the one before allocates
// nothing from the heap. Tensors use a separate pool: MemoryPool.

// Keeps its pool alive. Without a pool allocates on the heap. Not thread-safe, like Context.
template <class T>
class StepAllocator {
 public:
  using value_type = T;
  using propagate_on_container_copy_assignment = std::true_type;
  using propagate_on_container_move_assignment = std::true_type;
  using propagate_on_container_swap = std::true_type;

  StepAllocator() = default;
  explicit StepAllocator(std::shared_ptr<std::pmr::memory_resource> pool)
      : pool_(std::move(pool)) {}
  template <class U>
  StepAllocator(const StepAllocator<U>& other) : pool_(other.pool()) {}  // NOLINT: rebinds

  T* allocate(std::size_t n) {
    return static_cast<T*>(resource().allocate(n * sizeof(T), alignof(T)));
  }
  void deallocate(T* p, std::size_t n) { resource().deallocate(p, n * sizeof(T), alignof(T)); }

  const std::shared_ptr<std::pmr::memory_resource>& pool() const { return pool_; }
  template <class U>
  bool operator==(const StepAllocator<U>& other) const {
    return pool_ == other.pool();
  }

 private:
  std::pmr::memory_resource& resource() const {
    return pool_ ? *pool_ : *std::pmr::new_delete_resource();
  }
  std::shared_ptr<std::pmr::memory_resource> pool_;
};

template <class T>
using StepVector = std::vector<T, StepAllocator<T>>;

// A pool for the allocators of one context.
std::shared_ptr<std::pmr::memory_resource> MakeStepMemory();

// A best-fit allocator in one long address range: takes the smallest free range that fits and
// merges free neighbours. So the memory of activations can serve gradients of other sizes, unlike
// with size classes.

// Not thread-safe. Deterministic: a training step that starts in the same state as the previous one
// needs no more memory.
class AddressArena {
 public:
  AddressArena() = default;
  ~AddressArena();
  AddressArena(const AddressArena&) = delete;
  AddressArena& operator=(const AddressArena&) = delete;

  static std::size_t Rounded(std::size_t bytes);  // the size that Allocate actually takes
  // Uninitialised, aligned to kAlignment. Throws std::bad_alloc if the system has no memory, like
  // operator new, and is then unchanged.
  std::byte* Allocate(std::size_t bytes);
  void Free(std::byte* data, std::size_t bytes);  // `bytes` as passed to Allocate
  void Trim();                                    // returns free memory to the system

  std::size_t held() const { return held_; }        // memory in use now or ever
  std::size_t growths() const { return growths_; }  // how often held() had to grow

 private:
  using FreeRanges = std::pmr::map<std::byte*, std::size_t>;
  struct Region {
    std::byte* begin;
    std::size_t reserved, used, usable;  // addresses reserved; handed out so far; backed by memory
  };
  FreeRanges::iterator BestFit(std::size_t size);
  std::byte* Grow(std::size_t size);
  void AddRegion(std::size_t bytes);

  std::pmr::unsynchronized_pool_resource nodes_;  // of the map: no allocation in steady state
  FreeRanges free_{&nodes_};
  std::vector<Region> regions_;  // the last one grows
  std::size_t held_ = 0, growths_ = 0;
};

}  // namespace tilegrad::nn

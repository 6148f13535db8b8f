// SPDX-License-Identifier: Apache-2.0
// Memory of the small objects that every training step creates and drops: graph nodes, lists of
// Vars. It returns to a pool, so that a step like the one before allocates nothing from the heap.
// Tensors have a pool of their own: memory.h.
#pragma once

#include <cstddef>
#include <memory>
#include <memory_resource>
#include <utility>
#include <vector>

namespace tilegrad::nn {

// Keeps its pool alive. Made without one it allocates on the heap. Not thread-safe: as a Context.
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

}  // namespace tilegrad::nn

// SPDX-License-Identifier: Apache-2.0
// Memory for kernels: vectors aligned to cache lines, and an arena of scratch that is reused from
// frame to frame.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace tilegrad {

// Two cache lines: the widest vector of any target, and no false sharing.
inline constexpr std::size_t kAlignment = 128;

// Memory aligned to kAlignment. Large blocks begin on a huge page and ask the system for such
// pages: fewer page faults at the start, fewer TLB misses in every pass.
void* AllocateAligned(std::size_t bytes);
void FreeAligned(void* data, std::size_t bytes);  // `bytes` as it was allocated

template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}  // NOLINT: rebinding is implicit by design
  T* allocate(std::size_t n) { return static_cast<T*>(AllocateAligned(n * sizeof(T))); }
  void deallocate(T* p, std::size_t n) { FreeAligned(p, n * sizeof(T)); }
  bool operator==(const AlignedAllocator&) const { return true; }
};

template <class T>
using AlignedVector = std::vector<T, AlignedAllocator<T>>;

// Scratch memory handed out by bumping a pointer and taken back all at once. Memory grows to the
// largest use and is then reused, so a steady loop that calls Reset() allocates nothing. Not for
// objects with destructors. Not thread-safe.
class Arena {
 public:
  // Uninitialised memory for n objects, aligned to kAlignment; valid until Reset().
  template <class T>
  std::span<T> Allocate(std::size_t n) {
    static_assert(std::is_trivially_destructible_v<T>);
    return {static_cast<T*>(AllocateBytes(n * sizeof(T))), n};
  }
  // Takes everything back. If the last round overflowed into extra blocks, they are merged into
  // one.
  void Reset();
  std::size_t capacity() const;  // bytes held

 private:
  void* AllocateBytes(std::size_t bytes);
  std::vector<AlignedVector<std::byte>> blocks_;
  std::size_t used_ = 0;  // in the last block
};

}  // namespace tilegrad

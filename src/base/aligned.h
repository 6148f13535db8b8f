// SPDX-License-Identifier: Apache-2.0
// Memory for kernels: vectors aligned to cache lines, an arena of scratch that is reused from frame
// to frame, and bytes that the system may keep on disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/file.h"

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

// Bytes that are read now and then, such as all pictures of a dataset: too many for the memory, so
// that the system may keep some on disk.

// Up to 1 GiB in memory. More are mapped from a file without a name in the folder of temporary
// files (TMPDIR, else /tmp), which the system frees with the object or the process; in memory all
// the same if the folder has no room for them.
class ScratchBytes {
 public:
  static constexpr std::size_t kInMemory = std::size_t{1} << 30;
  ScratchBytes() = default;
  explicit ScratchBytes(std::size_t in_memory) : in_memory_(in_memory) {}
  ScratchBytes(ScratchBytes&& other) noexcept
      : in_memory_(other.in_memory_), bytes_(std::exchange(other.bytes_, {})) {}
  ScratchBytes& operator=(ScratchBytes&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~ScratchBytes() { Free(); }

  // The first `size` bytes of a file, as it is while it is mapped; writes to them stay here.
  static Result<ScratchBytes> OfFile(const Path& file, std::size_t size);

  // Zeros instead of what there was. std::bad_alloc if there is no memory either.
  void Resize(std::size_t size);
  void Assign(std::span<const std::uint8_t> bytes);

  std::uint8_t* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }
  std::uint8_t* begin() const { return data(); }
  std::uint8_t* end() const { return data() + size(); }
  std::uint8_t& operator[](std::size_t i) const { return bytes_[i]; }

 private:
  void Free();

  std::size_t in_memory_ = kInMemory;
  std::span<std::uint8_t> bytes_;
};

}  // namespace tilegrad

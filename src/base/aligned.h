// SPDX-License-Identifier: Apache-2.0
// Memory for kernels: vectors aligned to cache lines, a scratch arena reused from frame to frame,
// and bytes that the system may page out to disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad {

// Two cache lines: the widest vector of any target, and no false sharing.
inline constexpr std::size_t kAlignment = 128;

// Memory aligned to kAlignment. Large blocks start on a huge page and are advised to use them:
// fewer page faults at the start, fewer TLB misses in every pass.
void* AllocateAligned(std::size_t bytes);
void FreeAligned(void* data, std::size_t bytes);  // `bytes` as allocated

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

// Scratch memory: Allocate bumps a pointer, Reset frees everything at once. The arena grows to the
// largest use and then reuses its memory, so a steady loop that calls Reset() allocates nothing.
// Not for objects with destructors. Not thread-safe.
class Arena {
 public:
  // Uninitialised memory for n objects, aligned to kAlignment; valid until Reset().
  template <class T>
  std::span<T> Allocate(std::size_t n) {
    static_assert(std::is_trivially_destructible_v<T>);
    return {static_cast<T*>(AllocateBytes(n * sizeof(T))), n};
  }
  // Frees everything. If the last round overflowed into extra blocks, merges them into one.
  void Reset();
  std::size_t capacity() const;  // bytes held

 private:
  void* AllocateBytes(std::size_t bytes);
  std::vector<AlignedVector<std::byte>> blocks_;
  std::size_t used_ = 0;  // in the last block
};

// Rarely read bytes, such as all pictures of a dataset: too many for memory, so the system may page
// them out to disk.

// Up to 1 GiB stays in memory. More is mapped from an unnamed file in the temporary folder (TMPDIR,
// else /tmp), which the system frees with the object or the process; if the folder has no room, it
// stays in memory too.
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

  // Maps the first `size` bytes of a file copy-on-write: writes do not reach the file, later
  // changes of the file may show.
  static Result<ScratchBytes> OfFile(const Path& file, std::size_t size);

  // Replaces the contents with zeros. Throws std::bad_alloc if memory runs out too.
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

// SPDX-License-Identifier: Apache-2.0
// Counts the heap allocations of a whole test program, the libraries in it included, by replacing
// operator new: for exactly one source file of a program.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <new>

namespace tilegrad::test {

inline std::atomic<long> g_allocations{0};
inline std::atomic<long> g_refused{std::numeric_limits<long>::max()};  // the first that fails

inline void* CountedAllocate(std::size_t size, std::size_t alignment) {
  if (++g_allocations > g_refused) throw std::bad_alloc();
  void* p = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (p == nullptr) std::abort();
  return p;
}

}  // namespace tilegrad::test

void* operator new(std::size_t size) {
  return tilegrad::test::CountedAllocate(size, alignof(std::max_align_t));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return tilegrad::test::CountedAllocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

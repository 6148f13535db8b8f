// SPDX-License-Identifier: Apache-2.0
// Prefetching.
#pragma once

#include <hwy/base.h>

#include <cstddef>

namespace tilegrad {

inline constexpr std::size_t kLineFloats = 16;  // per cache line

// Prefetches the cache line of `data`. The empty asm statement keeps it: GCC 12 treats a function
// that only prefetches as one without effect and drops the call.
HWY_INLINE void PrefetchLine(const void* data) {
  __builtin_prefetch(data);
  asm volatile("");
}

// Prefetches `count` four-byte numbers, a line at a time.
template <class T>
HWY_INLINE void PrefetchNumbers(const T* data, std::size_t count) {
  static_assert(sizeof(T) == sizeof(float));
  for (std::size_t i = 0; i < count; i += kLineFloats) PrefetchLine(data + i);
}

// Prefetches a line for writing: other cores give it up now rather than at the write. In assembly,
// since without -mprfchw GCC would prefetch for reading. Every x86-64 executes the instruction or
// ignores it.
HWY_INLINE void PrefetchLineToWrite(float* data) {
#if HWY_ARCH_X86_64 && HWY_COMPILER_GCC
  asm volatile("prefetchw %0" : : "m"(*data));
#else
  __builtin_prefetch(data, 1);
#endif
}

// Prefetches a line into L2 only: for data used some thousand cycles later.
HWY_INLINE void PrefetchLineToL2(const void* data) {
  __builtin_prefetch(data, 0, 2);
  asm volatile("");
}

}  // namespace tilegrad
